"""The engine of studies: every chunk once, whoever does it, and workers that die."""

import os
import socket
import sys
from pathlib import Path

import pytest

from densarm.errors import DensarmError, InvalidValueError
from densarm.study.cluster import as_completed

DIES = "__import__('os').kill(__import__('os').getpid(), 9)"
"""A chunk for the work `eval`, which a process of its own can be told of."""


def test_one_job_is_done_here_without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert list(as_completed(eval, ["__import__('os').getpid()", "2"])) == [os.getpid(), 2]
    with pytest.raises(DensarmError, match=r"jobs = 2.*pip install 'densarm\[cluster\]'"):
        list(as_completed(eval, ["1"], jobs=2))


@pytest.mark.slow
def test_worker_that_dies_costs_its_chunk_only(tmp_path: Path) -> None:
    mark = str(tmp_path / "died")
    once = f"__import__('os').path.exists({mark!r}) or open({mark!r}, 'w').close() or {DIES}"
    told: list[str] = []
    chunks = [once, *map(str, range(10, 30))]
    found = list(as_completed(eval, chunks, jobs=2, on_workers=told.append))
    assert sorted(found) == [True, *range(10, 30)]
    assert told[0].startswith("2 processes")


@pytest.mark.slow
def test_chunk_at_which_workers_die_is_told_when_all_others_are_done() -> None:
    found: list[int] = []
    with pytest.raises(DensarmError, match="1 of 11 chunks were left"):
        found.extend(as_completed(eval, [DIES, *map(str, range(10))], jobs=2))
    assert sorted(found) == list(range(10))


SLOW = pytest.param("tcp://127.0.0.1:9", marks=pytest.mark.slow)


@pytest.mark.parametrize("address", [SLOW, "nonsense", "foo://127.0.0.1:9"])
def test_no_scheduler(address: str) -> None:
    with pytest.raises(InvalidValueError, match="must be the address of a Dask scheduler") as told:
        list(as_completed(eval, ["1"], scheduler=address))
    assert "\n" not in str(told.value)


@pytest.mark.slow
def test_what_listens_and_is_no_scheduler() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(InvalidValueError, match="must be the address of a Dask scheduler"):
            list(as_completed(eval, ["1"], scheduler=address))


def test_jobs_are_left_out_where_there_is_a_scheduler() -> None:
    with pytest.raises(InvalidValueError, match="left out where there is a scheduler"):
        list(as_completed(eval, ["1"], jobs=2, scheduler="tcp://127.0.0.1:9"))
