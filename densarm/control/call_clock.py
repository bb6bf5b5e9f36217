"""CallClock: the time between calls, as far as a clock can be believed."""

import math

from densarm.control.guard_status import GuardStatus, GuardWord


class CallClock:
    """Tells the time since the last call, and what is wrong with it.

    Args:
        period: time between two calls [s].
        longest_gap: longest time between two that are not late [s].
    """

    def __init__(self, period: float, longest_gap: float) -> None:
        self._period = period
        self._longest_gap = longest_gap
        self._time: float | None = None

    def restart(self) -> None:
        """Let the next call have any time."""
        self._time = None

    def elapsed(self, t: float) -> tuple[float, GuardStatus | None]:
        """Return the time since the last call [s], a period where it is not known, and the fault.

        Args:
            t: the time now [s], or anything.
        """
        try:
            now = float(t)
        except (TypeError, ValueError, OverflowError):
            now = math.nan
        last, self._time = self._time, now
        if not math.isfinite(now):
            self._time = None if last is None else last + self._period
            sentence = f"The time {t!r} is not a finite number."
            return self._period, GuardStatus(GuardWord.CLOCK, sentence)
        if last is None:
            return self._period, None
        if now < last:
            sentence = f"The time ran back from {last:.6g} s to {now:.6g} s."
            return self._period, GuardStatus(GuardWord.CLOCK, sentence)
        if now - last <= self._longest_gap:
            return now - last, None
        what = f"The call at t = {now:.6g} s came {now - last:.3g} s after the last one"
        sentence = f"{what}, more than {self._longest_gap:.3g} s."
        return now - last, GuardStatus(GuardWord.LATE, sentence)
