"""Files: read as text or TOML, written whole or not at all; what C++ prints, caught."""

import os
import re
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any, BinaryIO, TextIO
from zipfile import BadZipFile

from densarm.errors import FileContentError

if TYPE_CHECKING:
    from densarm.values.arrays import Array

MAX_BYTES = 20_000_000
"""Size of the largest text file that is read."""


def read_text(path: Path) -> str:
    """Return a text file's content; FileContentError if it is none, not text, or too large."""
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise FileContentError(path, f"larger than {MAX_BYTES / 1e6:g} MB")
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a UTF-8 text file"
        raise FileContentError(path, str(reason)) from None


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file; FileContentError, with the line, if it is not TOML."""
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except ValueError as error:  # also for a date that no calendar has
        raise FileContentError(path, f"not TOML: {error}") from None
    except RecursionError:
        raise FileContentError(path, "not TOML: nested too deeply") from None


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file that appears under its name only when the block ends well.

    Raises:
        FileContentError: its folder does not exist, or cannot be written to.
    """
    try:
        descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise FileContentError(path, f"cannot be written: {error.strerror}") from None
    try:
        with os.fdopen(descriptor, "wb") as file:
            yield file
        Path(temporary).chmod(0o644)  # mkstemp gives access to the owner alone
        Path(temporary).replace(path)
    except OSError as error:
        raise FileContentError(path, f"cannot be written: {error.strerror}") from None
    finally:
        Path(temporary).unlink(missing_ok=True)


_waits: list[Callable[[str], object]] = []


@contextmanager
def on_waiting(tell: Callable[[str], object]) -> Iterator[None]:
    """Call `tell` with a phrase before anything that is computed once on a machine."""
    _waits.append(tell)
    try:
        yield
    finally:
        _waits.remove(tell)


def kept_arrays(
    key: str, compute: Callable[[], dict[str, "Array"]], doing: str
) -> dict[str, "Array"]:
    """Return arrays by name, computed once on this machine for a key that tells all they depend on.

    They are kept where numba keeps kernels if ``NUMBA_CACHE_DIR`` says so, or else in the user's
    folder for caches; where neither can be written to, they are computed each time. `on_waiting`
    tells of it by the phrase.
    """
    import numpy as np  # for which the command line's help would wait

    # Not Path.expanduser, which raises where the user has no home.
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111
    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(caches, "densarm"))
    path = folder / f"densarm-{sha256(key.encode()).hexdigest()}.npz"
    with suppress(OSError, ValueError, EOFError, BadZipFile), path.open("rb") as file:
        return dict(np.load(file))
    for tell in _waits:
        tell(doing)
    arrays = compute()
    with suppress(OSError, FileContentError):
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
    return arrays


@contextmanager
def captured_stderr(messages: bytes) -> Iterator[list[str]]:
    """Catch what a C++ library prints on the process's standard error, file descriptor 2.

    Python's `sys.stderr` goes on showing lines meanwhile. What others print past it is shown when
    the block ends, but for what a thread is writing at that very instant. Where several threads
    catch, one waits for the other.

    Args:
        messages: regular expression of the library's messages, from the start of a line; those
            found fill the list when the block ends.
    """
    caught: list[str] = []
    pattern = re.compile(rb"^(?:" + messages + rb")", re.MULTILINE)
    with _CAPTURING, tempfile.TemporaryFile("a+b") as file:
        own, shown = sys.stderr, os.dup(2)
        sys.stderr = meanwhile = _stderr_past_descriptor_2(own)
        os.dup2(file.fileno(), 2)
        try:
            yield caught
        finally:
            os.dup2(shown, 2)
            if sys.stderr is meanwhile:
                sys.stderr = own
            # Not by the position in the file, which moves while other threads are writing.
            printed = os.pread(file.fileno(), file.seek(0, os.SEEK_END), 0)
            caught += [match[0].decode(errors="replace") for match in pattern.finditer(printed)]
            with suppress(OSError), os.fdopen(shown, "wb") as standard_error:  # and close it
                standard_error.write(pattern.sub(b"", printed))


_CAPTURING = RLock()


def _stderr_past_descriptor_2(own: TextIO) -> TextIO:
    """Return what `sys.stderr` shall be while file descriptor 2 is caught."""
    try:
        own.flush()
        if own.fileno() != 2:
            return own
    except (AttributeError, OSError, ValueError):  # there is none, it is closed, or a notebook's
        return own
    os.dup2(2, _second_stderr().fileno())
    return _second_stderr()


@cache
def _second_stderr() -> TextIO:
    # Never closed, since another thread may have taken hold of it.
    return os.fdopen(os.dup(2), "w", buffering=1, errors="backslashreplace", closefd=False)
