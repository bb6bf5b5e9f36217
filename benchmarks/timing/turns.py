"""Calls timed in turns, so that what slows the machine for a while slows all of them."""

import gc
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from timing.spread import Spread

Call = Callable[[int], object]
"""Does its work at one state, given by its index."""


def time_in_turns(
    calls: Mapping[str, Call],
    blocks: Sequence[range],
    rounds: int,
    clock: Callable[[], float] = time.process_time,
) -> dict[str, list[list[float]]]:
    """Return for each call, for each visit of a block, the time of each of its states [s].

    Args:
        calls: what is timed, by name.
        blocks: ranges of consecutive states; the first is visited once more, before, unrecorded.
        rounds: how often each block is visited.
        clock: of the process's CPU time, all of its threads counted, or of what passes [s].
    """
    times: dict[str, list[list[float]]] = {name: [] for name in calls}
    gc.collect()
    for call in calls.values():
        _seconds(call, blocks[0], clock)
    for _ in range(rounds):
        for block in blocks:
            for name, call in calls.items():
                times[name].append(_seconds(call, block, clock))
    return times


def ratios(times: Sequence[Sequence[float]], unit: Sequence[Sequence[float]]) -> Spread:
    """Return the spread, over the visits, of one call's median in units of another's."""
    pairs = zip(times, unit, strict=True)
    return Spread.of([float(np.median(a) / np.median(b)) for a, b in pairs])


def blocks_of(states: range, count: int, length: int) -> list[range]:
    """Return ranges from the middle of the states, one after the other without a gap.

    What a step remembers of the one before then counts as it does at work.
    """
    first = max(0, (len(states) - count * length) // 2)
    begins = range(first, first + count * length, length)
    return [states[begin : begin + length] for begin in begins]


def _seconds(call: Call, block: range, clock: Callable[[], float]) -> list[float]:
    seconds = []
    for k in block:
        began = clock()
        call(k)
        seconds.append(clock() - began)
    return seconds
