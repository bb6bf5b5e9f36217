"""Files are read whole, appear whole or not at all; C++ lines are caught, others are shown."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from densarm.errors import FileContentError
from densarm.values.arrays import Array
from densarm.values.files import (
    atomic_file,
    captured_stderr,
    kept_arrays,
    on_waiting,
    read_text,
    read_toml,
)


def test_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "run.bin"
    with atomic_file(path) as file:
        file.write(b"half")
        assert not path.exists()
        file.write(b"whole")
    assert path.read_bytes() == b"halfwhole"
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_failure_keeps_the_old_file(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "run.bin"
    path.write_bytes(b"old")
    with pytest.raises(error), atomic_file(path) as file:  # noqa: PT012
        file.write(b"new")
        raise error
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written(tmp_path: Path) -> None:
    for path, reason in ((tmp_path / "no" / "run", "No such file"), (tmp_path, "directory")):
        with pytest.raises(FileContentError, match=rf"cannot be written: .*{reason}"):  # noqa: SIM117
            with atomic_file(path) as file:
                file.write(b"new")


def test_text_files(tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text('\ufeff<robot name="é"/>', encoding="utf-8")
    assert read_text(file) == '<robot name="é"/>'
    file.write_bytes(b"\xff")
    with pytest.raises(FileContentError, match="not a UTF-8 text file"):
        read_text(file)
    with pytest.raises(FileContentError, match="No such file"):
        read_text(tmp_path / "other")
    with pytest.raises(FileContentError, match="Is a directory"):
        read_text(tmp_path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_may_end_in_any_way(tmp_path: Path, end: str) -> None:
    file = tmp_path / "robot.urdf"
    file.write_bytes(f"a{end}b{end}".encode())
    assert read_text(file) == "a\nb\n"


def test_endless_text_is_refused() -> None:
    with pytest.raises(FileContentError, match="larger than 20 MB"):
        read_text(Path("/dev/zero"))


def test_toml(tmp_path: Path) -> None:
    file = tmp_path / "arm.toml"
    file.write_text("a = 1")
    assert read_toml(file) == {"a": 1}
    file.write_text("a = \n")
    with pytest.raises(FileContentError, match=r"arm.toml: not TOML: .*line 1"):
        read_toml(file)
    file.write_text(f"a = {'[' * 5000}{']' * 5000}")
    with pytest.raises(FileContentError, match="nested too deeply"):
        read_toml(file)


def test_messages_of_the_library_are_caught(capfd: pytest.CaptureFixture[str]) -> None:
    with captured_stderr(rb"Error: .*\n  at line \d\n|eigen: .*\n") as messages:
        os.write(2, b"Error: one\n  at line 7\nno Error: \xff\n  indented\neigen: two\n\n")
        print("eigen: three", file=sys.__stderr__, flush=True)
    assert messages == ["Error: one\n  at line 7\n", "eigen: two\n", "eigen: three\n"]
    os.write(2, b"shown\n")
    assert capfd.readouterr().err == "no Error: \ufffd\n  indented\n\nshown\n"


def test_messages_are_caught_when_the_block_fails(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(KeyError), captured_stderr(rb".*\n") as messages:  # noqa: PT012
        os.write(2, b"\xff why\n")
        raise KeyError
    assert messages == ["\ufffd why\n"]
    os.write(2, b"shown\n")
    assert capfd.readouterr().err == "shown\n"


def test_no_file_descriptor_is_left_open() -> None:
    before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    for _ in range(5):
        with captured_stderr(b""):
            pass
    assert len(os.listdir("/proc/self/fd")) == before  # noqa: PTH208


TALK = """
import os, sys, threading, time
from densarm.values.files import captured_stderr

early = sys.stderr

def talk():
    for k in range(1000):
        sys.stderr.write(f"now {k}\\n")

def load(name):
    for _ in range(50):
        with captured_stderr(rb"Error: .*\\n") as messages:
            time.sleep(1e-4)
            os.write(2, f"Error: {name}\\n".encode())
        assert messages == [f"Error: {name}\\n"], messages
    sys.stderr.write("done\\n")

def talk_past_python():
    for k in range(300):
        early.write(f"early {k}\\n")
        os.write(2, f"raw {k}\\n".encode())

talkers = [threading.Thread(target=talk) for _ in range(2)]
loaders = [threading.Thread(target=load, args=[name]) for name in "ab"]
for thread in [*loaders, *talkers]:
    thread.start()
for thread in [*loaders, *talkers]:
    thread.join()
assert sys.stderr is early
with captured_stderr(b"Error"):
    sys.stderr.write("at once\\n")
    thread = threading.Thread(target=talk_past_python)
    thread.start()
    thread.join()
    sys.stderr.write("still at once\\n")
"""


def test_what_other_threads_print_meanwhile_is_not_lost() -> None:
    done = subprocess.run(
        [sys.executable, "-c", TALK], capture_output=True, text=True, check=True, timeout=60
    )
    lines = done.stderr.splitlines()
    meanwhile = [f"now {k}" for k in range(1000)] * 2
    assert sorted(lines[:2002]) == sorted([*meanwhile, "done", "done"])
    past = [f"{way} {k}" for k in range(300) for way in ("early", "raw")]
    assert lines[2002:] == ["at once", "still at once", *past]


def test_a_missing_toml_file_is_called_missing(tmp_path: Path) -> None:
    with pytest.raises(FileContentError) as caught:
        read_toml(tmp_path / "none.toml")
    assert str(caught.value) == f"{tmp_path / 'none.toml'}: No such file or directory"


def test_arrays_are_computed_once_for_a_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    asked: list[str] = []

    def array(key: str) -> float:
        def compute() -> dict[str, Array]:
            asked.append(key)
            return {"x": np.full(2, float(len(asked)))}

        return float(kept_arrays(key, compute, f"computing {key}")["x"][1])

    told: list[str] = []
    with on_waiting(told.append):
        assert [array("a"), array("b"), array("a")] == [1.0, 2.0, 1.0]
    assert told == ["computing a", "computing b"]
    for file in (tmp_path / "densarm").iterdir():
        file.write_bytes(b"PK broken")
    assert array("a") == 3.0
    assert array("a") == 3.0
    elsewhere = tmp_path / "a file"
    elsewhere.touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(elsewhere))
    assert [array("a"), array("a")] == [4.0, 5.0]  # nowhere to keep them
