"""The figures of a set of problems."""

import click

from densarm.bench.problem_results import ProblemResults
from densarm.outcome import Outcome

_COUNTED = (Outcome.COLLIDED, Outcome.STUCK, Outcome.NO_PATH)
_COLUMNS = (
    "reach-\ned",
    "certi-\nfied",
    "colli-\nded",
    "stuck",
    "no\npath",
    "else",
    "of",
    "planning\n[s]",
    "first\nmotion",
    "motion\n[s]",
    "/ opti-\nmal",
    "path\n[rad]",
    "clear\n[mm]",
    "di-\nrect",
)
_WIDTH = 110  # characters, at least


def print_problem_sets(results: ProblemResults, direct: ProblemResults | None = None) -> None:
    """Print one row a set of problems: how its runs ended, and percentiles of their measures.

    Args:
        results: of all sets.
        direct: of the same problems without a planner, if they were run so too.
    """
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
    rows = {
        name: _row(results.of(name), direct and direct.of(name)) for name in (*results.sets, None)
    }
    shown = [column for column in range(len(_COLUMNS)) if any(row[column] for row in rows.values())]
    table.add_column("set", no_wrap=True)
    for column in shown:
        table.add_column(Text(_COLUMNS[column]), justify="right")
    for name, row in rows.items():
        table.add_row(name or "all", *(row[column] for column in shown))
    Console(width=max(Console().width, _WIDTH), highlight=False).print(table)
    _print_unsolved(results)


def _row(part: ProblemResults, direct: ProblemResults | None) -> list[str]:
    planning = part.percentiles("plan_time_s") or []
    smallest = part.min_clearance
    counts = [part.count(outcome) for outcome in _COUNTED]
    reached = part.count(Outcome.REACHED)
    return [
        str(reached),
        str(part.certified),
        *map(str, counts),
        str(part.total - reached - sum(counts)),
        str(part.total),
        " ".join(f"{value:.2f}" for value in planning),
        _median(part, "preparation_time_s"),
        _median(part, "motion_s"),
        _median(part, "optimal_ratio"),
        _median(part, "path_length_rad"),
        "" if smallest is None else f"{smallest * 1e3:.1f}",
        "" if direct is None else str(direct.count(Outcome.REACHED)),
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
