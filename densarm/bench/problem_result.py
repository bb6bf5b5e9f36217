"""ProblemResult: how one problem's run ended."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ProblemResult:
    """How one problem's run ended."""

    scene: str
    """The set that the problem belongs to."""
    index: int
    """Its place in the set."""
    outcome: str
    """One of `RUN_ENDS`."""
    detail: str = ""
    """What stood in the way, as a phrase."""
    duration_s: float | None = None
    """Simulated time [s]; None where nothing ran, as in what follows."""
    min_clearance_m: float | None = None
    """Smallest signed distance [m]; None without pairs."""
    goal_error_rad: float | None = None
    """Largest joint error at the end [rad or m]."""
    peak_torque_ratio: float | None = None
    """Largest torque in units of its limit."""
    plan_time_s: float | None = None
    """Wall-clock time that the guide took [s]."""
    preparation_time_s: float | None = None
    """Wall-clock time from the scenario to the first torque [s], where the record tells it."""
    motion_s: float | None = None
    """Simulated time from which on the arm was at the goal and at rest [s]."""
    optimal_s: float | None = None
    """Shortest time along the same path under the same limits [s], where that was asked for."""
    path_length_rad: float | None = None
    """Length of the way in joint space [rad or m]."""
    certified: bool = False
    """Whether the certificate holds in every part."""

    @property
    def optimal_ratio(self) -> float | None:
        """Time of the motion in units of the shortest along the same path."""
        if self.motion_s is None or self.optimal_s is None:
            return None
        return self.motion_s / self.optimal_s
