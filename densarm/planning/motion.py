"""Motion: a way to the goal that was planned, timed and proved."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from densarm.arms.upright import Upright
from densarm.density.sub_goals import GuidePath
from densarm.errors import DensarmError, InvalidValueError
from densarm.planning.guide import WayPoints
from densarm.values.arrays import Array
from densarm.values.checks import positive
from densarm.values.documented import documented, in_short
from densarm.values.kernels import compiled, compiled_part
from densarm.values.outcome import Outcome
from densarm.world.tracking_tube import tracking_tube
from densarm.world.world import World


@documented
@dataclass(frozen=True)
class TimingParameters:
    """Shares of the limits that a motion may use; the rest is left to feedback.

    Raises:
        InvalidValueError: a share outside (0, 1], or a jerk that is not positive.
    """

    velocity_share: float = 0.95
    """Share of the velocity limits."""
    acceleration_share: float = 0.9
    """Share of the acceleration limits."""
    torque_share: float = 0.9
    """Share of the torque limits."""
    torque_rate_share: float = 0.9
    """Share of the limits of the change of torque, where the arm has any."""
    jerk: float | None = None
    """Largest jerk of any joint [rad/s³ or m/s³], below the arm's own limits; None for those."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name.endswith("_share") and not 0.0 < value <= 1.0:
                raise InvalidValueError(name, value, "above 0 and at most 1")
        if self.jerk is not None:
            positive("jerk", self.jerk)


class MotionSample(NamedTuple):
    """One instant of a motion; continuous joints count their turns."""

    position: Array
    """Joint positions (nv,) [rad or m]."""
    velocity: Array
    """Joint velocities (nv,) [rad/s or m/s]."""
    acceleration: Array
    """Joint accelerations (nv,) [rad/s² or m/s²]."""


class MotionSamples(NamedTuple):
    """A motion at equal intervals, for another controller."""

    time: Array
    """From 0 to the end of the motion, which may come sooner than a whole interval (N,) [s]."""
    position: Array
    """Joint positions (N, nv) [rad or m]; continuous joints count their turns."""
    velocity: Array
    """Joint velocities (N, nv) [rad/s or m/s]."""
    acceleration: Array
    """Joint accelerations (N, nv) [rad/s² or m/s²]."""

    def __repr__(self) -> str:
        return f"MotionSamples({len(self.time)} of {self.position.shape[1]} joints)"

    def joint_trajectory(self, joint_names: Sequence[str]) -> dict[str, Any]:
        """Return them as JSON data in the shape of ROS's trajectory_msgs/JointTrajectory."""
        points = []
        for time, position, velocity, acceleration in zip(*self, strict=True):
            seconds, nanoseconds = divmod(round(1e9 * time), 10**9)
            points.append(
                {
                    "positions": position.tolist(),
                    "velocities": velocity.tolist(),
                    "accelerations": acceleration.tolist(),
                    "time_from_start": {"secs": seconds, "nsecs": nanoseconds},
                }
            )
        return {"joint_names": list(joint_names), "points": points}


@documented
@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory q_d(t), interpolated by cubic Hermite polynomials; at rest beyond its ends."""

    period: float
    """Time between two knots [s]."""
    position: Array
    """Joint positions at the knots (N, nv) [rad or m], N >= 2; continuous joints count turns."""
    velocity: Array
    """Joint velocities there (N, nv) [rad/s or m/s], zero in the first and last row."""
    margin: float = 0.0
    """Safety margin m that it was planned with [m]."""
    path: GuidePath | None = None
    """The sub-goals that led it; None where none did."""
    goal: Array | None = None
    """Configuration that it was planned to (nq,), of several the one that was chosen."""
    way_points: WayPoints | None = None
    """What it passes on the way; None where nothing was asked for."""
    upright: Upright | None = None
    """What it keeps upright; None where nothing was asked for."""
    plan_time: float = 0.0
    """Wall-clock time that the search for them took [s]; zero without a search."""
    detail: str = ""
    """Why it ends short of the goal; empty where it does not."""
    remark: str = ""
    """Which critical points of ρ its curve left, and how; empty where it met none."""
    world: World | None = None
    """The arm among obstacles that it was planned for; None where nothing is known of them."""

    def __repr__(self) -> str:
        end = f"{self.duration:.3f} s to {in_short(self.position[-1])}"
        return f"Motion({end}, margin={self.margin:g})"

    @cached_property
    def tube(self) -> Array | None:
        """Bounds ε on the tracking error under which it stays clear (nv,) [rad or m], or None.

        They are proved when first asked for, among obstacles as they are then: see
        `tracking_tube`.
        """
        if self.world is None:
            return None
        return tracking_tube(self.world, self.position, self.velocity)

    @property
    def duration(self) -> float:
        """Time at which it comes to rest [s]."""
        return self.period * (len(self.position) - 1)

    @cached_property
    def knots(self) -> Array:
        """Joint positions and velocities in one array (2, N, nv)."""
        return np.array([self.position, self.velocity], dtype=np.float64)

    def sample(self, t: float, lead: float = 0.0) -> MotionSample:
        """Return position, velocity and acceleration.

        Args:
            t: time of position and velocity [s].
            lead: how much later the acceleration is taken [s]; half of the time that a torque is
                held makes it the mean over that time.
        """
        out = np.empty((3, self.position.shape[1]))
        t = float(t)  # other numbers would have the kernel compiled for them
        _sample(t / self.period, (t + lead) / self.period, self.period, self.knots, out)
        return MotionSample(*out)

    def samples(self, period: float) -> MotionSamples:
        """Return the motion at equal intervals, its end included.

        Args:
            period: time between two samples [s].

        Raises:
            InvalidValueError: a period that is not positive, or of more than 10⁶ samples.
        """
        if self.duration > _MOST_SAMPLES * positive("period", period):
            least = self.duration / _MOST_SAMPLES
            raise InvalidValueError("period", period, f"at least {least:.2g} s, for 10⁶ samples")
        steps = int(np.ceil(self.duration / period - 1e-9))
        time = np.minimum(period * np.arange(steps + 1), self.duration)
        return MotionSamples(time, *np.stack([self.sample(t) for t in time], axis=1))


class PlanningError(DensarmError):
    """There is no motion to the goal.

    Args:
        outcome: infeasible, no_path, stuck or timed_out.
        detail: why, as a phrase.
        motion: how far the density leads where it gets stuck.
    """

    def __init__(self, outcome: Outcome, detail: str, motion: Motion | None = None) -> None:
        self.outcome, self.detail, self.motion = outcome, detail, motion
        super().__init__(f"{outcome}: {detail}")

    def __reduce__(self) -> tuple[type["PlanningError"], tuple[Outcome, str]]:
        """Leave the motion behind, whose world cannot go to another process."""
        return PlanningError, (self.outcome, self.detail)


_MOST_SAMPLES = 10**6

_ROUNDING = 1e-6  # of a period; at a knot the acceleration is that after it, however time rounds


@compiled
def _sample(u: float, u_acceleration: float, period: float, knots: Array, out: Array) -> None:
    write_sample(u, u_acceleration, period, knots, out)


@compiled_part
def write_sample(u: float, u_acceleration: float, period: float, knots: Array, out: Array) -> None:
    """Write position, velocity and acceleration to the first rows of `out` (3 or more, nv).

    Times u are in periods [s], knots as in `Motion.knots` (2, N, nv).
    """
    last = knots.shape[1] - 1
    u = 0.0 if u < 0.0 else float(last) if u > last else u
    k = math.floor(u) if u < last else last - 1
    x = u - k
    y = 1.0 - x
    step, bump = x * x * (3.0 - 2.0 * x), x * y
    step_slope, slope_a, slope_b = 6.0 * bump / period, y * (1.0 - 3.0 * x), x * (3.0 * x - 2.0)
    later = u_acceleration + _ROUNDING
    moves = u_acceleration >= 0.0 and later < last
    m = math.floor(later) if moves else 0
    z = 6.0 * (u_acceleration - m)
    k_next, m_next = k + 1, m + 1
    for j in range(knots.shape[2]):
        a, va, vb = knots[0, k, j], knots[1, k, j], knots[1, k_next, j]
        rise = knots[0, k_next, j] - a
        out[0, j] = a + step * rise + period * bump * (y * va - x * vb)
        out[1, j] = step_slope * rise + slope_a * va + slope_b * vb
        rise = (knots[0, m_next, j] - knots[0, m, j]) / period
        slopes = (z - 4.0) * knots[1, m, j] + (z - 2.0) * knots[1, m_next, j]
        out[2, j] = ((6.0 - 2.0 * z) * rise + slopes) / period if moves else 0.0
