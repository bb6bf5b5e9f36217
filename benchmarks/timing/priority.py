"""The priority that a control loop has on a robot."""

import argparse
import os


def add_fifo_option(parser: argparse.ArgumentParser) -> None:
    """Add the option that asks for it."""
    parser.add_argument("--fifo", action="store_true", help="real-time priority, where allowed")


def take_priority() -> None:
    """Let this process go before all that have no real-time priority."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
