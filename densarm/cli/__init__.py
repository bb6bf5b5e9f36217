"""The command line; ``densarm --help`` explains it."""

from densarm.cli.entry_point import main

__all__ = ["main"]
