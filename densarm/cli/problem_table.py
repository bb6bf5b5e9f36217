"""The figures of a set of problems."""

import click

from densarm.bench.problem_results import PERCENTILES, ProblemResults
from densarm.outcome import RUN_ENDS, Outcome

_COLUMN = 18  # characters


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
    for result in results.results:
        if result.outcome != Outcome.REACHED or not result.certified:
            word = "not certified" if result.outcome == Outcome.REACHED else result.outcome
            detail = f": {result.detail}" if result.detail else ""
            click.echo(f"{result.scene} {result.index} {word}{detail}")


def _print(label: str, value: str) -> None:
    click.echo(f"{label:<{_COLUMN}}{value}")
