"""The same work on many items, one by one or in several processes."""

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from densarm.validation import positive_integer

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[Result]:
    """Yield the result of each item, in the order of the items.

    Args:
        work: what to do; with its items and results it can be pickled.
        items: what to do it on.
        jobs: processes; 1 for this one.

    Raises:
        InvalidValueError: a number of processes below one.
    """
    if positive_integer("jobs", jobs) == 1:
        yield from map(work, items)
        return
    # Ctrl-C reaches the whole group of processes: it ends these at once, and only this one tells.
    pool = ProcessPoolExecutor(
        jobs, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_DFL)
    )
    try:
        yield from pool.map(work, items)
    finally:
        pool.shutdown(cancel_futures=True)
