"""The way along a straight line: joint positions that lead a frame, proved clear."""

from numpy.typing import ArrayLike

from densarm.arms.line import Line, Segment
from densarm.density.sub_goals import GuidePath
from densarm.errors import DensarmError, InvalidValueError, UnknownNameError
from densarm.planning.motion import PlanningError
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.swept_check import SweptCheck, SweptResult, SweptVerdict


def straight_way(check: SweptCheck, start: ArrayLike, line: Line) -> tuple[GuidePath, Segment]:
    """Return the way along a line from a configuration (nq,), and where the line leads.

    Raises:
        PlanningError: it cannot be followed to its end, with how far, or meets something.
        UnknownNameError: no such frame.
    """
    arm = check.arm
    start = arm.check_configuration("start", start)
    if fault := infeasibility(check, {"start": start}):
        raise PlanningError(Outcome.INFEASIBLE, fault)
    segment = line.segment(arm, start)
    try:
        points = arm.configurations(segment.joint_positions(arm, start))
    except (UnknownNameError, InvalidValueError):
        raise
    except DensarmError as error:
        raise PlanningError(Outcome.NO_PATH, str(error)) from None
    found = check.check(points)
    if found.verdict != SweptVerdict.CLEAR:
        reason = f"the {line} is blocked {_blocked(check, points, segment.length, found)}"
        raise PlanningError(Outcome.NO_PATH, reason)
    return GuidePath(points, is_clear=True, found_by="a straight line"), segment


def _blocked(check: SweptCheck, points: Array, length: float, found: SweptResult) -> str:
    """Return where a way (N, nq) along a line of a length [m] is not clear first, and of what."""
    for k, q in enumerate(points):
        if fault := infeasibility(
            check, {f"after {1e3 * length * k / (len(points) - 1):.3g} mm": q}
        ):
            return fault
    return f"at {found.index} of {len(points)} points: {' and '.join(found.pairs[0])} may touch"
