"""Certificates: what is proved about a recorded run."""

from densarm.certificates.certificate import Certificate, Check, certify
from densarm.certificates.replay import replay_errors

__all__ = [
    "Certificate",
    "Check",
    "certify",
    "replay_errors",
]
