"""The table of a comparison."""

from collections.abc import Sequence

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from densarm.outcome import RUN_ENDS, Outcome
from densarm.study.comparison import Comparison, MethodResult

_SHOWN = {
    "reach-\ned": Outcome.REACHED,
    "colli-\nded": Outcome.COLLIDED,
    "stuck": Outcome.STUCK,
}
_COLUMNS = {
    "time\n[s]": ("time_s", 1.0, ".2f"),
    "path\n[rad]": ("path_length_rad", 1.0, ".2f"),
    "clear\n[mm]": ("min_clearance_m", 1e3, ".1f"),
    "effort\n[N²m²s]": ("effort", 1.0, ".0f"),
    "ready\n[s]": ("preparation_time_s", 1.0, ".2f"),
    "step\n[µs]": ("step_us", 1.0, ".0f"),
}
_WIDTH = 90  # characters, at least, so that no number is cut; most tables need 80


def print_comparison(comparison: Comparison) -> None:
    """Print one row a method: how its runs ended, and the medians of its measures."""
    table = Table(
        title=f"{comparison.scenario}, {comparison.starts} starts, seed {comparison.seed}",
        caption="Medians: of the step over all runs, else over the runs that reached the goal.\n"
        + _tuning(comparison),
        box=SIMPLE,
        padding=0,
        show_edge=False,
        title_justify="left",
        caption_justify="left",
    )
    table.add_column("method", no_wrap=True)
    for heading in (*_SHOWN, "else", *_COLUMNS):
        table.add_column(Text(heading), justify="right")
    for result in comparison.methods:
        table.add_row(*_row(result))
    width = max(Console().width, _WIDTH)
    Console(width=width, highlight=False).print(table)


def _tuning(comparison: Comparison) -> str:
    if comparison.tuning_starts == 0:
        return "No parameter was tuned."
    scales = ", ".join(
        f"{result.parameter} × {result.scale:g} ({result.method})" for result in comparison.methods
    )
    return f"Tuned on {comparison.tuning_starts} other starts: {scales}."


def _row(result: MethodResult) -> Sequence[str]:
    shown = [result.count(outcome) for outcome in _SHOWN.values()]
    other = sum(result.count(outcome) for outcome in RUN_ENDS) - sum(shown)
    counts = [str(count) for count in (*shown, other)]
    measures = [
        _number(result.median(measure), scale, form) for measure, scale, form in _COLUMNS.values()
    ]
    return [result.method, *counts, *measures]


def _number(value: float | None, scale: float, form: str) -> str:
    return "–" if value is None else format(scale * value, form)
