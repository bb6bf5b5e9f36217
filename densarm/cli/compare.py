"""``densarm compare``: the density and its baselines, side by side."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from densarm.cli.options import PLOT_ENDINGS, number_option, output_option
from densarm.cli.output import print_table, progress, write_json
from densarm.values.outcome import RUN_ENDS, Outcome

if TYPE_CHECKING:
    from densarm.study.comparison import Comparison

_COUNTED = {
    "reach-\ned": Outcome.REACHED,
    "colli-\nded": Outcome.COLLIDED,
    "stuck": Outcome.STUCK,
}
_MEASURED = {
    "time\n[s]": ("time_s", 1.0, ".2f"),
    "path\n[rad]": ("path_length_rad", 1.0, ".2f"),
    "clear\n[mm]": ("min_clearance_m", 1e3, ".1f"),
    "effort\n[N²m²s]": ("effort", 1.0, ".0f"),
    "ready\n[s]": ("preparation_time_s", 1.0, ".2f"),
    "step\n[µs]": ("step_us", 1.0, ".0f"),
}


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
@output_option("--plot", "FILE", "Plot outcomes and measures.", PLOT_ENDINGS)
@output_option("--json", "FILE", "Write every run and the medians as JSON.")
def compare(
    scenario: str,
    methods: str | None,
    starts: int,
    seed: int | None,
    tuning_starts: int,
    plot: Path | None,
    json: Path | None,
) -> None:
    """Compare methods on SCENARIO: a name of `densarm list`, or a TOML file.

    Every method drives the arm by torque from the same starts to the scenario's goal, with the same
    distances, margins, gains and seed, and plans with 0.9 of the velocity, acceleration and torque
    limits. Its main parameter (in brackets) is tuned: at 1, 0.2 and 5 times the default it runs
    from other starts; what reaches most often, then fastest, is taken.

    \b
    density               tracks a planned, timed curve by density (sensing distance)
    density_direct        follows the plain density to the goal (sensing distance)
    density_time_varying  the same of obstacles that move, 2024 (sensing distance)
    control_density       the control density program, 2024 (sensing distance)
    potential_field       Khatib 1986 (influence distance)
    navigation_function   Rimon, Koditschek 1992 (kappa)
    cbf_qp                the goal's pull, filtered by barrier functions (barrier rate)
    plan_then_track       the curve of `density` by computed torque (sensing distance)

    The exit status is 0 when the comparison was completed, whatever was reached.

    \b
    Example:
      densarm compare swing_up --starts 10 --plot compare.png --json compare.json
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.scenarios.scenario import load_scenario
        from densarm.study.baselines import BASELINES
        from densarm.study.comparison import compare as compare_baselines
        from densarm.study.comparison import comparison_figure

        names = list(BASELINES) if methods is None else methods.split(",")
        loaded = load_scenario(scenario)
        comparison = compare_baselines(loaded, names, starts, seed, tuning_starts, report)
        report("writing")
        if plot:
            from densarm.visualization.figure_style import save_figure

            save_figure(comparison_figure(comparison), plot)
        if json:
            write_json(json, comparison.to_json())
    _print_comparison(comparison)


def _print_comparison(comparison: "Comparison") -> None:
    """Print one row a baseline: how its runs ended, and the medians of its measures."""
    rows = []
    for result in comparison.baselines:
        row = {"method": result.baseline}
        row |= {heading: str(result.count(outcome)) for heading, outcome in _COUNTED.items()}
        others = set(RUN_ENDS) - set(_COUNTED.values())
        row["else"] = str(sum(map(result.count, others)))
        for heading, (measure, scale, form) in _MEASURED.items():
            value = result.median(measure)
            row[heading] = "–" if value is None else format(scale * value, form)
        rows.append(row)
    tuned = "No parameter was tuned."
    if comparison.tuning_starts > 0:
        scales = ", ".join(
            f"{result.parameter} × {result.scale:g} ({result.baseline})"
            for result in comparison.baselines
        )
        tuned = f"Tuned on {comparison.tuning_starts} other starts: {scales}."
    print_table(
        rows,
        "Medians: of the step over all runs, else over the runs that reached the goal.\n" + tuned,
        f"{comparison.scenario}, {comparison.starts} starts, seed {comparison.seed}",
    )
