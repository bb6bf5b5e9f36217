"""``densarm compare``: the density and its baselines, side by side."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from densarm.cli.options import (
    PLOT_ENDINGS,
    Decorator,
    number_option,
    output_option,
    worker_options,
)
from densarm.cli.output import print_table, progress, write_json
from densarm.values.outcome import FAILED, RUN_ENDS, Outcome

if TYPE_CHECKING:
    from densarm.study.comparison import BaselineResult, Comparison
    from densarm.study.conditions import Condition

_COUNTED = {
    "rea-\nched": (Outcome.REACHED, 1),
    "coll-\nided": (Outcome.COLLIDED, -1),
    "stuck": (Outcome.STUCK, 0),
}
"""Headings of counts, and whether more of them is better (1), worse (-1) or neither."""

_MEASURED = {
    "time\n[s]": ("time_s", 1.0, ".2f", -1),
    "path\n[rad]": ("path_length_rad", 1.0, ".2f", -1),
    "clear\n[mm]": ("min_clearance_m", 1e3, ".1f", 1),
    "effort\n[N²m²s]": ("effort", 1.0, ".0f", -1),
    "ready\n[s]": ("preparation_time_s", 1.0, ".2f", 0),
    "step\n[µs]": ("step_us", 1.0, ".0f", 0),
}
"""Headings of medians: measure, factor, format, and whether more of it is better; of this machine's
times that is not told, as they differ from run to run."""

_MARK, _NONE = "*", "–"


def disturbance_option(name: str, unit: str, help_text: str) -> Decorator:
    """Return a decorator that adds an option of a size above zero, None without it."""
    kind = click.FloatRange(min=0.0, min_open=True, max=1e3)
    return click.option(name, type=kind, metavar=unit, help=help_text)


@click.command()
@click.argument("scenario")
@click.option(
    "--methods",
    metavar="A,B,...",
    help="Some of those below.  [default: all]",
)
@number_option("--starts", 5, "Starts: the scenario's own, the others at random.")
@number_option(
    "--seed",
    None,
    "Seed of the starts and the planner.  [default: what the scenario says, else 0]",
    least=0,
)
@number_option(
    "--tuning-starts",
    3,
    "Other starts that each method's main parameter is tuned on; 0 keeps the defaults.",
    least=0,
)
@number_option(
    "--budget", 3, "Values that tuning tries of each main parameter, from 1/5 to 5 times."
)
@disturbance_option(
    "--push", "RAD/S", "Also run each start with this push of every joint, at 0.3 s."
)
@disturbance_option("--payload", "KG", "Also run each with a mass that no controller knows of.")
@disturbance_option("--moving", "M/S", "Also run each with a ball of this speed across the way.")
@worker_options
@output_option("--plot", "FILE", "Plot outcomes and measures.", PLOT_ENDINGS)
@output_option("--json", "FILE", "Write every run and the medians as JSON.")
def compare(
    scenario: str,
    methods: str | None,
    starts: int,
    seed: int | None,
    tuning_starts: int,
    budget: int,
    push: float | None,
    payload: float | None,
    moving: float | None,
    jobs: int,
    scheduler: str | None,
    plot: Path | None,
    json: Path | None,
) -> None:
    """Compare methods on SCENARIO: a name of `densarm list`, or a TOML file.

    Every method drives the arm by torque from the same starts to the scenario's goal, with the same
    distances, margins, gains and seed, and plans with 0.9 of the velocity, acceleration and torque
    limits. Its main parameter (in brackets) is tuned, each at as many values: it runs from other
    starts, and what reaches most often, then touches least, then is the fastest, is taken.

    \b
    density              tracks a planned, timed curve by density (sensing distance)
    density_direct       follows the plain density to the goal (sensing distance)
    density_moving       the same of obstacles that move, 2024 (sensing distance)
    control_density      the control density program, 2024 (sensing distance)
    potential_field      Khatib 1986 (influence distance)
    navigation_function  Rimon, Koditschek 1992 (kappa)
    cbf_qp               the goal's pull, filtered by barrier functions (barrier rate)
    plan_then_track      the curve of `density` by computed torque (sensing distance)

    A push, a payload and a ball that crosses the way are run besides, each alone and the same for
    all methods. The last line of a table says where the best form of the density is better and
    worse than the best of the others.

    The exit status is 0 when the comparison was completed, whatever was reached.

    \b
    Example:
      densarm compare swing_up --starts 10 --push 1 --moving 0.5 --json compare.json
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.scenarios.scenario import load_scenario
        from densarm.study.baselines import BASELINES
        from densarm.study.comparison import compare as compare_baselines
        from densarm.study.comparison import comparison_figure
        from densarm.study.conditions import Condition

        names = list(BASELINES) if methods is None else methods.split(",")
        loaded = load_scenario(scenario)
        sizes = {"push": push, "payload": payload, "moving": moving}
        asked = [Condition(**{key: size}) for key, size in sizes.items() if size is not None]
        comparison = compare_baselines(
            loaded,
            names,
            starts,
            seed,
            tuning_starts,
            report,
            conditions=[Condition(), *asked],
            budget=budget,
            jobs=jobs,
            scheduler=scheduler,
        )
        report("writing")
        if plot:
            from densarm.visualization.figure_style import save_figure

            save_figure(comparison_figure(comparison), plot)
        if json:
            write_json(json, comparison.to_json())
    _print_comparison(comparison)


def _print_comparison(comparison: "Comparison") -> None:
    """Print a table a condition, and what tuning chose."""
    for condition in comparison.conditions:
        results = comparison.under(condition)
        rows = [{"method": result.baseline, **_cells(result)} for result in results]
        _mark_best(rows, [result.count(Outcome.REACHED) for result in results])
        failures: dict[str, dict[str, None]] = {}
        for result in results:
            for run in result.runs:
                if run.outcome == FAILED:
                    failures.setdefault(run.detail, {})[result.baseline] = None
        title = f"{comparison.scenario}, {comparison.starts} starts, seed {comparison.seed}"
        told = [f"{', '.join(names)} failed: {detail}." for detail, names in failures.items()]
        told += _verdict(comparison, condition)
        print_table(rows, "\n".join(told), f"{title}: {condition.name}")
    click.echo(
        "Medians: of the step over all runs, else over the runs that reached the goal.\n"
        f"{_MARK} the best; of medians, among those that reached most often."
    )
    from densarm.study.baselines import MAIN_PARAMETERS

    tuned = "No parameter was tuned"
    if comparison.tuning_starts > 0:
        tuned = f"Tuned on {comparison.tuning_starts} other starts, {comparison.budget} values each"
    click.echo(f"{tuned}:")
    for result in comparison.under(comparison.conditions[0]):
        unit = MAIN_PARAMETERS[result.baseline].unit
        click.echo(f"  {result.baseline:<22}{result.parameter} {result.value:.3g} {unit}".rstrip())


_SIGNS = {heading: sign for heading, (_, sign) in _COUNTED.items() if sign}
_SIGNS |= {heading: sign for heading, (_, _, _, sign) in _MEASURED.items() if sign}


def _cells(result: "BaselineResult") -> dict[str, str]:
    """Return how the runs of a baseline ended, and the medians of its measures."""
    row = {heading: str(result.count(outcome)) for heading, (outcome, _) in _COUNTED.items()}
    others = set(RUN_ENDS) - {outcome for outcome, _ in _COUNTED.values()}
    row["else"] = str(sum(map(result.count, others)))
    for heading, (measure, scale, form, _) in _MEASURED.items():
        value = result.median(measure)
        row[heading] = _NONE if value is None else format(scale * value, form)
    return row


def _mark_best(rows: list[dict[str, str]], reached: list[int]) -> None:
    """Mark the best cells of each column, medians among the rows that reached most often."""
    most = [row for row, count in zip(rows, reached, strict=True) if count == max(reached)]
    for heading, sign in _SIGNS.items():
        among = rows if heading in _COUNTED else most
        cells = [sign * float(row[heading]) for row in among if row[heading] != _NONE]
        for row in among:
            if row[heading] != _NONE and sign * float(row[heading]) == max(cells):
                row[heading] += _MARK


def _verdict(comparison: "Comparison", condition: "Condition") -> list[str]:
    """Return, as a line, where the best form of the density differs from the best other."""
    rivals = comparison.rivals(condition)
    if rivals is None:
        return []
    ours, theirs = map(_cells, rivals)
    found: dict[int, list[str]] = {1: [], -1: []}
    for heading, sign in _SIGNS.items():
        if _NONE in (ours[heading], theirs[heading]):
            continue
        gain = sign * (float(ours[heading]) - float(theirs[heading]))
        if gain:
            word = heading.partition("\n")[0] if heading in _MEASURED else _COUNTED[heading][0]
            found[1 if gain > 0.0 else -1].append(word)
    names = " against ".join(result.baseline for result in rivals)
    better, worse = (", ".join(found[sign]) or "nothing" for sign in (1, -1))
    return [f"{names}: better in {better}; worse in {worse}."]
