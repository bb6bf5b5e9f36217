"""``densarm compare``: the density and its rivals, side by side."""

import logging
from pathlib import Path

import click

from densarm.cli.exit_status import ExitStatus
from densarm.cli.json_file import write_json
from densarm.cli.output_option import output_option
from densarm.cli.progress import progress


@click.command()
@click.argument("scenario")
@click.option(
    "--methods",
    metavar="A,B,...",
    help="Some of density, density_direct, potential_field, navigation_function, cbf_qp, "
    "plan_then_track.  [default: all]",
)
@click.option(
    "--starts",
    type=click.IntRange(min=1),
    default=5,
    show_default=True,
    help="Starts: the scenario's own, the others at random.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Seed of the starts and the planner.  [default: what the scenario says, else 0]",
)
@click.option(
    "--tuning-starts",
    type=click.IntRange(min=0),
    default=3,
    show_default=True,
    help="Other starts that each method's main parameter is tuned on; 0 keeps the defaults.",
)
@output_option("--plot", "FILE", "Plot outcomes and measures.", endings=(".png", ".pdf", ".svg"))
@output_option("--json", "FILE", "Write every run and the medians as JSON.")
def compare(
    scenario: str,
    methods: str | None,
    starts: int,
    seed: int | None,
    tuning_starts: int,
    plot: Path | None,
    json: Path | None,
) -> int:
    """Compare methods on SCENARIO: a name of `densarm list`, or a TOML file.

    Every method drives the arm by torque from the same starts to the scenario's goal, with the same
    distances, margins, gains and seed, and plans with 0.9 of the velocity, acceleration and torque
    limits. Its main parameter (in brackets) is tuned: at 1, 0.2 and 5 times the default it runs
    from other starts; what reaches most often, then fastest, is taken.

    \b
    density              tracks a planned, timed curve by density (sensing distance)
    density_direct       follows the plain density to the goal (sensing distance)
    potential_field      Khatib 1986 (influence distance)
    navigation_function  Rimon, Koditschek 1992 (kappa)
    cbf_qp               the goal's pull, filtered by barrier functions (barrier rate)
    plan_then_track      the curve of `density` by computed torque (sensing distance)

    The exit status is 0 when the comparison was completed, whatever was reached.

    \b
    Example:
      densarm compare swing_up --starts 10 --plot compare.png --json compare.json
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.cli.comparison_table import print_comparison
        from densarm.scenario import load_scenario
        from densarm.study.comparison import compare as compare_methods
        from densarm.study.methods import METHODS

        names = list(METHODS) if methods is None else methods.split(",")
        loaded = load_scenario(scenario)
        comparison = compare_methods(loaded, names, starts, seed, tuning_starts, report)
        report("writing")
        if plot:
            logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it tells of its font cache
            from densarm.visualization.comparison_plot import save_comparison_plot

            save_comparison_plot(comparison, plot)
        if json:
            write_json(json, comparison.to_json())
    print_comparison(comparison)
    return ExitStatus.SUCCESS
