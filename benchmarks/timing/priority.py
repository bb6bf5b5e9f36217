"""The priority that a control loop has on a robot."""

import argparse
import os
import sys


def add_fifo_option(parser: argparse.ArgumentParser) -> None:
    """Add the option that asks for it."""
    parser.add_argument("--fifo", action="store_true", help="real-time priority, where allowed")


def take_priority() -> None:
    """Let this process go before all that have no real-time priority.

    Raises:
        SystemExit: it is not allowed to, or the system has no such priority.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except PermissionError:
        sys.exit("--fifo: real-time priority is not allowed; raise `ulimit -r`, or leave it out")
    except AttributeError:
        sys.exit(f"--fifo: {sys.platform} has no such priority; leave it out")
