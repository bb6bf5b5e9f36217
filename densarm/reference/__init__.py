"""References: trajectories q_d(t) on the planning system's curve; SciPy only when one is made."""

from densarm.reference.infeasible_timing import InfeasibleTimingError
from densarm.reference.reference import Reference, ReferencePoint
from densarm.reference.timing_parameters import TimingParameters

__all__ = [
    "InfeasibleTimingError",
    "Reference",
    "ReferencePoint",
    "TimingParameters",
]
