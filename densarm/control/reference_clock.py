"""ReferenceClock: the time σ of a reference along a motion, which waits, pauses and goes on."""

import math

import numpy as np

from densarm.planning.motion import Motion
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_part
from densarm.world.stopping import HELD_SHARE

# Numbers of the clock: σ, how far it is behind, its derivatives, whether a push is answered (above
# zero; below, for how long the arm may still join the motion), the last time asked for, where to go
# on from, and the rate that is wanted; then copies from LAG to EMERGENCY, as they were before the
# last time asked for.
TIME, LAG, RATE, CHANGE, EMERGENCY, LAST, GOES_ON_FROM, WANTED_RATE = 0, 1, 2, 3, 4, 5, 6, 7
N_CLOCK, _KEPT = 12, 7  # how many, and how far behind the clock its copy is

_JOINING = 1.0  # [s] that joining another motion takes at most
_PAUSED = 0.01  # σ̇ below which the reference counts as at rest
_CLOCK_RATE = 20.0  # ω [1/s]
_WAITING_ERROR, _FREE_ERROR = 0.03, 0.005  # ε, and what the reference does not wait for [rad or m]
LEAST_SHARE = 0.1  # of torque that counts as left
_LED_SHARE = 0.6  # of the acceleration limits, in which a led clock slows down and speeds up
_LED_LATE, _LED_SOON = (0.0, 0.05, 0.1, 0.15), 0.3  # [s] that its rate lags, and by how much
_STEEPEST = 10.0  # [1/s], its rate's slope where the motion is slow


class ReferenceClock:
    r"""The time σ(t) of a reference q_d(σ).

    It runs by

    .. math::

        \dddot\sigma = \omega^2 (r - \dot\sigma) - 2 \omega \ddot\sigma, \quad
        r = \frac{w}{1 + (|e| / \epsilon)^2} \sqrt{\min_i \Big( 1 - \frac{|\hat d_i|}
        {\tau^{max}_i - |H_i|} \Big)}

    both beyond a dead zone, w being one, or zero where it pauses: unknown torque leaves less for
    accelerations, which go with σ̇². `advance_clock` and `set_rate` are what a control step does.

    Args:
        numbers: where they are kept, (`N_CLOCK`,), overwritten.
    """

    def __init__(self, numbers: Array) -> None:
        self._numbers = numbers
        numbers[:], numbers[WANTED_RATE] = math.nan, 1.0

    @property
    def time(self) -> float:
        """σ at the last call [s]; not a number before the first."""
        return float(self._numbers[TIME])

    @property
    def is_paused(self) -> bool:
        """Whether the reference was made to pause, and rests."""
        return self._numbers[WANTED_RATE] == 0.0 and bool(self._numbers[RATE] < _PAUSED)

    def pause(self) -> None:
        """Come to rest."""
        self._numbers[WANTED_RATE] = 0.0

    def resume(self, time: float | None = None) -> None:
        """Go on after a pause, or begin at rest at a time [s] of the motion."""
        if time is not None:
            self._numbers[GOES_ON_FROM] = time
        self._numbers[WANTED_RATE] = 1.0

    def join(self) -> None:
        """Let the arm join a motion that it was not on: what it is off counts as no push."""
        self._numbers[EMERGENCY] = -_JOINING

    def lead(self, to: float, motion: Motion, most: Array) -> None:
        """Take the wanted rate a period nearer to another, within accelerations (nv,) along it."""
        rate = float(self._numbers[WANTED_RATE])
        if rate == to:
            return
        sign, slope = math.copysign(1.0, to - rate), _STEEPEST
        later = min(rate + _LED_SOON, 1.0) if to > rate else rate
        for ahead in _LED_LATE:
            sample = motion.sample(self.time + ahead * later)
            own = sign * later**2 * np.sign(sample.velocity) * sample.acceleration
            left = np.minimum(_LED_SHARE * most, HELD_SHARE * most - own)
            slope = min(slope, float((left / np.maximum(np.abs(sample.velocity), 1e-9)).min()))
        step = min(motion.period * max(slope, 0.0), abs(to - rate))
        self._numbers[WANTED_RATE] = to if step == abs(to - rate) else rate + sign * step


@compiled_part
def advance_clock(t: float, begins: bool, elapsed: float, numbers: Array) -> None:
    """Let σ go on to t, by the rate that the last call found."""
    if not math.isnan(numbers[GOES_ON_FROM]):
        numbers[LAG], numbers[RATE] = t - numbers[GOES_ON_FROM], 0.0
        numbers[CHANGE], numbers[EMERGENCY] = 0.0, min(numbers[EMERGENCY], 0.0)
        numbers[GOES_ON_FROM] = math.nan
    elif begins or math.isnan(numbers[TIME]):
        numbers[LAG] = numbers[CHANGE] = numbers[EMERGENCY] = 0.0
        numbers[RATE] = 1.0
    elif t == numbers[LAST]:  # asked again, which moves no clock
        for k in range(LAG, LAST):
            numbers[k] = numbers[k + _KEPT]
    else:
        numbers[LAG] += (1.0 - numbers[RATE]) * elapsed
    for k in range(LAG, LAST):
        numbers[k + _KEPT] = numbers[k]
    numbers[LAST], numbers[TIME] = t, t - numbers[LAG]


@compiled_part
def set_rate(largest: float, left: float, slowest: float, elapsed: float, numbers: Array) -> None:
    """Set σ̇ for the time until the next call.

    Args:
        largest: error |e| of a joint [rad or m].
        left: least share of a joint's torque that is left for accelerations.
        slowest: σ̈ below which a pause would break acceleration limits, at most zero.
        elapsed: time until then [s].
        numbers: of the clock.
    """
    waiting = max(largest - _FREE_ERROR, 0.0) / _WAITING_ERROR
    wanted = numbers[WANTED_RATE] * math.sqrt(max(left, LEAST_SHARE)) / (1.0 + waiting * waiting)
    step = min(_CLOCK_RATE * elapsed, 1.0)
    change = numbers[CHANGE]
    change += step * (_CLOCK_RATE * (wanted - numbers[RATE]) - 2.0 * change)
    if wanted == 0.0:
        change = max(change, slowest)
    numbers[CHANGE], numbers[RATE] = change, max(numbers[RATE] + elapsed * change, 0.0)
