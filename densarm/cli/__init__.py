"""The command line; ``densarm --help`` explains it."""

from densarm.cli.application import main

__all__ = ["main"]
