"""What C++ code prints is caught, also when the block fails."""

import os
import sys

import pytest

from densarm.captured_stderr import captured_stderr


def test_lines_are_caught(capfd):
    with captured_stderr() as lines:
        os.write(2, b"one\ntwo\n")
        print("three", file=sys.__stderr__, flush=True)
    assert lines == ["one", "two", "three"]
    os.write(2, b"shown\n")
    assert capfd.readouterr().err == "shown\n"


def test_lines_are_caught_when_the_block_fails(capfd):
    with pytest.raises(KeyError), captured_stderr() as lines:  # noqa: PT012
        os.write(2, b"\xff why\n")
        raise KeyError
    assert lines == ["\ufffd why"]
    os.write(2, b"shown\n")
    assert capfd.readouterr().err == "shown\n"


def test_no_file_descriptor_is_left_open():
    before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    for _ in range(5):
        with captured_stderr():
            pass
    assert len(os.listdir("/proc/self/fd")) == before  # noqa: PTH208
