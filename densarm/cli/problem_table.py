"""The figures of a set of problems."""

import click

from densarm.bench.problem_results import PERCENTILES, ProblemResults
from densarm.outcome import RUN_ENDS, Outcome

_COLUMN = 18  # characters

_SET_OUTCOMES = (Outcome.REACHED, Outcome.COLLIDED, Outcome.STUCK, Outcome.NO_PATH)
_SET_COLUMNS = (
    "reach-\ned",
    "colli-\nded",
    "stuck",
    "no\npath",
    "else",
    "certi-\nfied",
    "of",
    "planning\n[s]",
    "motion\n[s]",
    "path\n[rad]",
    "clear\n[mm]",
)
_SET_WIDTH = 96  # characters, at least


def print_problems(results: ProblemResults) -> None:
    """Print how the runs ended, the percentiles of their times, and what was not reached."""
    for outcome in RUN_ENDS:
        _print(outcome, f"{results.count(outcome)} of {results.total}")
    _print("certified", f"{results.certified} of {results.total}")
    for label, measure in {"planning": "plan_time_s", "motion": "duration_s"}.items():
        if values := results.percentiles(measure):
            times = ", ".join(f"{value:.2f}" for value in values)
            shares = ", ".join(str(share) for share in PERCENTILES)
            _print(label, f"{times} s ({shares} %)")
    smallest = results.min_clearance
    _print("min clearance", "no pairs" if smallest is None else f"{smallest * 1e3:.4g} mm")
    _print_unsolved(results)


def print_problem_sets(results: ProblemResults) -> None:
    """Print one row a set of problems: how its runs ended, and percentiles of their measures."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        caption="Medians over the runs that reached the goal; planning 50, 95 and 98 %.",
        box=SIMPLE,
        padding=0,
        show_edge=False,
        caption_justify="left",
    )
    table.add_column("set", no_wrap=True)
    for heading in _SET_COLUMNS:
        table.add_column(Text(heading), justify="right")
    for name, part in {**results.by_scene(), "all": results}.items():
        table.add_row(name, *_set_row(part))
    Console(width=max(Console().width, _SET_WIDTH), highlight=False).print(table)
    _print_unsolved(results)


def _set_row(part: ProblemResults) -> list[str]:
    planning = part.percentiles("plan_time_s") or []
    smallest = part.min_clearance
    return [
        *(str(part.count(outcome)) for outcome in _SET_OUTCOMES),
        str(part.total - sum(part.count(outcome) for outcome in _SET_OUTCOMES)),
        str(part.certified),
        str(part.total),
        " ".join(f"{value:.2f}" for value in planning),
        _median(part, "duration_s"),
        _median(part, "path_length_rad"),
        "" if smallest is None else f"{smallest * 1e3:.1f}",
    ]


def _median(part: ProblemResults, measure: str) -> str:
    values = part.percentiles(measure)
    return "" if values is None else f"{values[0]:.2f}"


def _print_unsolved(results: ProblemResults) -> None:
    for result in results.results:
        if result.outcome != Outcome.REACHED or not result.certified:
            word = "not certified" if result.outcome == Outcome.REACHED else result.outcome
            detail = f": {result.detail}" if result.detail else ""
            click.echo(f"{result.scene} {result.index} {word}{detail}")


def _print(label: str, value: str) -> None:
    click.echo(f"{label:<{_COLUMN}}{value}")
