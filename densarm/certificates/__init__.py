"""Certificates: what is proved about a recorded run."""

from densarm.certificates.certificate import Certificate, Check, certify, swept_result
from densarm.certificates.replay import replay_error

__all__ = [
    "Certificate",
    "Check",
    "certify",
    "replay_error",
    "swept_result",
]
