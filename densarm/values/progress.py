"""Progress: what long work tells of itself, and where a notebook shows it."""

import html
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

OnProgress = Callable[[str], None]
"""Told what is being done, as a phrase."""


@contextmanager
def shown_progress(given: OnProgress | None) -> Iterator[OnProgress]:
    """Give whom to tell: who is given, else a line below the cell of a notebook until all is done.

    Elsewhere nobody is told.
    """
    if given is not None or not is_in_notebook():
        yield given or (lambda _: None)
        return
    display: Any = sys.modules["IPython"].display
    line = display.display(display.HTML(""), display_id=True)
    try:
        yield lambda phrase: line.update(display.HTML(f"<small>{html.escape(phrase)}</small>"))
    finally:
        line.update(display.HTML(""))


def is_in_notebook() -> bool:
    """Return whether a kernel runs this, which shows what a cell displays."""
    if (ipython := sys.modules.get("IPython")) is None:
        return False
    return getattr(ipython.get_ipython(), "kernel", None) is not None
