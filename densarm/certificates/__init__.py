"""Certificates: what is proved about a recorded run."""

from densarm.certificates.certificate import Certificate, Check, certify, swept_result
from densarm.certificates.energy import EnergyRecord, EnergyVerdict, record_energy
from densarm.certificates.rantzer import RantzerRecord, record_rantzer
from densarm.certificates.replay import replay_errors

__all__ = [
    "Certificate",
    "Check",
    "EnergyRecord",
    "EnergyVerdict",
    "RantzerRecord",
    "certify",
    "record_energy",
    "record_rantzer",
    "replay_errors",
    "swept_result",
]
