"""``densarm study``: a scenario from many random starts, on this machine or many."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from densarm.cli.options import (
    PLOT_ENDINGS,
    number_option,
    output_option,
    plant_options,
    worker_options,
)
from densarm.cli.output import print_figures, progress
from densarm.values.outcome import RUN_ENDS, Outcome

if TYPE_CHECKING:
    from densarm.study.monte_carlo import Rows


def _read_ranges(
    ctx: click.Context, param: click.Parameter, texts: tuple[str, ...]
) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest value of each key, from texts KEY=LOW:HIGH."""
    told = {}
    for text in texts:
        key, _, ends = text.partition("=")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            example = "simulation.time_limit=5:10"
            message = f"{text!r}: must be KEY=LOW:HIGH, as in {example}"
            raise click.BadParameter(message, ctx, param) from None
        told[key] = low, high
    return told


@click.command()
@click.argument("scenario")
@number_option("--starts", 100, "Runs, each from a start that touches nothing.")
@number_option("--seed", 0, "Seed of starts, parameters and noise.", least=0)
@click.option(
    "--vary",
    multiple=True,
    callback=_read_ranges,
    metavar="KEY=LOW:HIGH",
    help="Draw a parameter of the scenario for each run, as in control.margin=0:0.01 or "
    "disturbances.payload=0:1. May be repeated.",
)
@plant_options
@worker_options
@output_option("--save", "STUDY.npz", "Keep every run; what is there is not run again.", (".npz",))
@output_option("--plot", "FILE", "Plot outcomes, their shares and clearances.", PLOT_ENDINGS)
def study(
    scenario: str,
    starts: int,
    seed: int,
    vary: dict[str, tuple[float, float]],
    plant: str | None,
    disturb: dict[str, Any],
    jobs: int,
    scheduler: str | None,
    save: Path | None,
    plot: Path | None,
) -> None:
    """Run SCENARIO from many starts: a name of `densarm list`, or a TOML file.

    Starts are drawn evenly within the position limits, continuous joints from a whole turn, and
    touch nothing; parameters and noise are drawn besides. Every run is planned, driven, and proved.
    Whatever runs it and in however many parts, the numbers are the same, bit for bit. An
    interrupted study goes on where it was with the same --save.

    More than one process and other machines need Dask (pip install 'densarm[cluster]').

    The exit status is 0 when all was run, whatever was reached.

    \b
    Examples:
      densarm study swing_up --starts 200 --jobs 2 --save study.npz --plot study.png
      densarm study panda_table --starts 50 --vary disturbances.payload=0:1
      densarm study panda_table --starts 10000 --scheduler tcp://10.0.0.1:8786 --save study.npz
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from dataclasses import replace

        from densarm.scenarios.scenario import load_scenario
        from densarm.simulation.disturbances import Disturbances
        from densarm.study.monte_carlo import Study, run_study, study_figure
        from densarm.values.tables import parse_table

        loaded = load_scenario(scenario)
        told = parse_table("disturbances", Disturbances, {**loaded.disturbances.given, **disturb})
        chosen = replace(loaded, plant=plant or loaded.plant, disturbances=told)
        asked = Study(chosen, seed, vary)
        rows = run_study(asked, starts, jobs, scheduler, save, report)
        if plot:
            report("writing")
            from densarm.visualization.figure_style import save_figure

            save_figure(study_figure(asked, rows), plot)
    click.echo(f"{chosen.title}: {starts} starts, seed {seed}\n")
    _print_rows(rows)


def _print_rows(rows: "Rows") -> None:
    """Print the share of each outcome with its interval at 95 %, and figures of those reached."""
    import numpy as np

    from densarm.study.monte_carlo import share

    reached = rows[rows["outcome"] == Outcome.REACHED]
    shares = {end: share(rows, end) for end in RUN_ENDS}
    figures = {end: f"{part.count}, {part}" for end, part in shares.items() if part.count}
    proved = share(rows, Outcome.REACHED, certified=True)
    known = rows["min_clearance_m"][np.isfinite(rows["min_clearance_m"])]
    if len(known):
        least, median = 1e3 * known.min(), 1e3 * np.median(known)
        figures["min clearance"] = f"{least:.4g} mm, median {median:.4g} mm"
    if len(reached):
        longest = reached["duration_s"].max()
        figures["duration"] = f"median {np.median(reached['duration_s']):.3f} s, {longest:.3f} s"
        figures["goal error"] = f"{reached['goal_error_rad'].max():.2g} rad at most"
    print_figures({"certified": f"{proved.count}, {proved}, reached besides", **figures})
