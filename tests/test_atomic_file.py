"""Files appear whole or not at all."""

import pytest

from densarm.atomic_file import atomic_file
from densarm.errors import FileContentError


def test_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "run.bin"
    with atomic_file(path) as file:
        file.write(b"half")
        assert not path.exists()
        file.write(b"whole")
    assert path.read_bytes() == b"halfwhole"
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_failure_keeps_the_old_file(tmp_path, error):
    path = tmp_path / "run.bin"
    path.write_bytes(b"old")
    with pytest.raises(error), atomic_file(path) as file:  # noqa: PT012
        file.write(b"new")
        raise error
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written(tmp_path):
    for path, reason in ((tmp_path / "no" / "run", "No such file"), (tmp_path, "directory")):
        with pytest.raises(FileContentError, match=rf"cannot be written: .*{reason}"):  # noqa: SIM117
            with atomic_file(path) as file:
                file.write(b"new")
