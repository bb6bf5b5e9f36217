"""A watch over one process that parses: what it may not do, and what it may not use up."""

import faulthandler
import os
import resource
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_FORBIDDEN = ("pickle.find_class", "subprocess.Popen", "os.system", "socket.connect", "os.exec")


class Watch:
    """Notes writes, pickles and processes; ends the process where an example takes too long.

    Args:
        folder: where the process works; nothing may appear in it.
        seconds: that an example may take.
        megabytes: of memory beyond what is in use now.
    """

    def __init__(self, folder: Path, seconds: float, megabytes: int) -> None:
        self.notes: list[str] = []
        self._seconds = seconds
        self._watching = False
        self._folder = folder
        scratch = folder / "scratch"
        scratch.mkdir()
        tempfile.tempdir = str(scratch)
        os.chdir(folder)
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + megabytes * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        self._output = tempfile.TemporaryFile()  # noqa: SIM115
        sys.addaudithook(self._audit)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Watch over the block, during which the process prints into a file."""
        before = self._content()
        self.notes.clear()
        sys.stdout.flush()
        shown = os.dup(1), os.dup(2)
        for stream in (1, 2):
            os.dup2(self._output.fileno(), stream)
        faulthandler.dump_traceback_later(self._seconds, exit=True, file=shown[1])
        self._watching = True
        try:
            yield
        finally:
            self._watching = False
            faulthandler.cancel_dump_traceback_later()
            sys.stdout.flush()
            for stream, was in zip((1, 2), shown, strict=True):
                os.dup2(was, stream)
                os.close(was)
        if os.lseek(self._output.fileno(), 0, os.SEEK_END):
            os.truncate(self._output.fileno(), 0)
            os.lseek(self._output.fileno(), 0, os.SEEK_SET)
            self.notes.append("printed")
        self.notes += [f"left {name}" for name in self._content() - before]

    def _content(self) -> set[str]:
        return {str(path) for path in self._folder.rglob("*")}

    def _audit(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._watching:
            return
        if event.startswith(_FORBIDDEN):
            self.notes.append(event)
        if event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITING:
            if isinstance(arguments[0], int):
                return  # no file, but what is open already
            path = str(arguments[0])
            # What C++ prints is caught in a temporary file that vanishes by itself.
            if not path.startswith(tempfile.gettempdir()):
                self.notes.append(f"opened {path} to write")
