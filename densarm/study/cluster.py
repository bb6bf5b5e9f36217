"""The engine of studies: chunks of work in this process, in several, or on machines by Dask."""

import asyncio
import logging
import pickle
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, suppress
from functools import partial
from importlib.util import find_spec
from threading import Lock
from typing import Any, TypeVar

from densarm.errors import DensarmError, InvalidValueError
from densarm.values.checks import positive_integer

Chunk = TypeVar("Chunk")
Result = TypeVar("Result")

_CONNECTING = 3.0  # [s]
_SETTINGS = {
    "distributed.worker.profile.enabled": False,  # which looks every 10 ms at what runs
    "distributed.admin.large-graph-warning-threshold": "1GB",  # z1_window's meshes have 16 MB
}


def as_completed(
    work: Callable[[Chunk], Result],
    chunks: Sequence[Chunk],
    jobs: int = 1,
    scheduler: str | None = None,
    on_workers: Callable[[str], None] = lambda _: None,
) -> Generator[Result, None, None]:
    """Do the same work on many chunks, and yield what comes of each as it comes, in any order.

    A chunk whose worker dies is done again by another; one at which three more die is left, and
    told when all others are done.

    Args:
        work: what to do; with chunks and results it can be pickled.
        chunks: what to do it on.
        jobs: processes on this machine; 1 for this one, without Dask.
        scheduler: address of a Dask scheduler whose workers do it, in place of processes here.
        on_workers: told who does it, and the dashboard's address if there is one, as a phrase.

    Raises:
        InvalidValueError: a number of processes below one, or beside a scheduler.
        DensarmError: Dask is not installed, no scheduler is there, or its workers have no densarm;
            and, at the end, chunks that were left.
    """
    if positive_integer("jobs", jobs) > 1 and scheduler is not None:
        raise InvalidValueError("jobs", jobs, "left out where there is a scheduler")
    if jobs == 1 and scheduler is None:
        yield from map(work, chunks)
        return
    distributed = _require_dask(f"jobs = {jobs}" if scheduler is None else "scheduler")
    import dask

    with ExitStack() as stack:
        stack.enter_context(dask.config.set(_SETTINGS))
        if scheduler is None:
            has_dashboard = find_spec("bokeh") is not None
            cluster = distributed.LocalCluster(
                n_workers=jobs,
                threads_per_worker=1,
                memory_limit=0,  # none: what runs out of it is told by the system
                dashboard_address="127.0.0.1:0",  # any port; without bokeh it tells next to nothing
                silence_logs=logging.CRITICAL,
                preload=__name__,
            )
            where = stack.enter_context(cluster)
            doing = f"{jobs} processes"
            doing += f", dashboard {cluster.dashboard_link}" if has_dashboard else ""
            client = stack.enter_context(distributed.Client(where))
        else:
            client = stack.enter_context(_connected(distributed, scheduler))
            doing = f"workers of {scheduler}, dashboard {client.dashboard_link}"
        on_workers(doing)
        yield from _results(distributed, client, work, chunks)


def in_order(
    work: Callable[[Chunk], Result],
    chunks: Sequence[Chunk],
    jobs: int = 1,
    scheduler: str | None = None,
    on_done: Callable[[int], None] = lambda _: None,
) -> list[Result]:
    """Do the same work on many chunks as `as_completed` does, and return all results in order.

    Args and errors are those of `as_completed`; `on_done` is told how many are done, each time.
    """
    found: dict[int, Result] = {}
    numbered = list(enumerate(chunks))
    with closing(as_completed(partial(_numbered, work), numbered, jobs, scheduler)) as results:
        for index, result in results:
            found[index] = result
            on_done(len(found))
    return [found[index] for index in range(len(chunks))]


def _numbered(work: Callable[[Chunk], Result], item: tuple[int, Chunk]) -> tuple[int, Result]:
    index, chunk = item
    return index, work(chunk)


def _results(
    distributed: Any, client: Any, work: Callable[[Chunk], Result], chunks: Sequence[Chunk]
) -> Iterator[Result]:
    # A task and not scattered data, which would be lost with the workers that hold it.
    shared = client.submit(pickle.loads, pickle.dumps(work), pure=False)
    workers = len(client.nthreads())
    futures = [client.submit(_alone, shared, chunk, pure=False) for chunk in chunks]
    chunk_of = {future.key: chunk for future, chunk in zip(futures, chunks, strict=True)}
    found, suspects, left = distributed.as_completed(futures, loop=client.loop), list[Chunk](), 0
    futures.clear()  # what has come is not kept
    for future in found:
        try:
            yield future.result()
        except distributed.KilledWorker:
            suspects.append(chunk_of[future.key])
        except ImportError as error:
            message = f"{error}, on a worker: install the same densarm there"
            raise DensarmError(message) from None
        future.release()
    for chunk in suspects:  # one by one: Dask blames those, too, that waited at a worker that died
        try:
            yield client.submit(_alone, shared, chunk, pure=False).result()
        except distributed.KilledWorker:
            left += 1
    if left:
        with suppress(TimeoutError):  # Dask cannot close while it starts a worker again
            client.wait_for_workers(workers, timeout=_CONNECTING)
        raise DensarmError(
            f"{left} of {len(chunks)} chunks were left, whose workers died again and again: the "
            "rest is done; is there memory enough?"
        )


def dask_setup(_worker: object) -> None:
    """Prepare a worker of this machine, as Dask calls it.

    Ctrl-C reaches the whole group of processes: this one is ended by the one that started it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)


_ONE_AT_A_TIME = Lock()


def _alone(work: Callable[[Chunk], Result], chunk: Chunk) -> Result:
    # Threads of one worker take turns: none is faster beside another, and models are not shared.
    with _ONE_AT_A_TIME:
        return work(chunk)


def _require_dask(asked: str) -> Any:
    try:
        import distributed
    except ImportError:
        message = f"{asked}: needs Dask, which is not installed: pip install 'densarm[cluster]'"
        raise DensarmError(message) from None
    return distributed


def _connected(distributed: Any, address: str) -> Any:
    # What goes on in the background when nobody answers is told below, in one line.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)

    async def ask() -> None:
        security = distributed.Security().get_connection_args("client")
        async with distributed.rpc(address, connection_args=security) as there:
            await there.identity()

    async def ask_in_time() -> None:
        await asyncio.wait_for(ask(), _CONNECTING)

    try:
        asyncio.run(ask_in_time())  # a client would wait for ever for what is no scheduler
        return distributed.Client(address, timeout=_CONNECTING, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError, MemoryError) as error:
        reason = " ".join(str(error).split()) or f"no such answer within {_CONNECTING:g} s"
        allowed = f"the address of a Dask scheduler, as in tcp://127.0.0.1:8786 ({reason})"
        raise InvalidValueError("scheduler", address, allowed) from None
