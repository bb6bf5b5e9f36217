"""``densarm run``: plan and simulate a scenario."""

from pathlib import Path

import click

from densarm.cli.exit_status import ExitStatus
from densarm.cli.first_run import compiling_meanwhile
from densarm.cli.json_file import write_json
from densarm.cli.output_option import output_option
from densarm.cli.picture_options import picture_options, write_pictures
from densarm.cli.progress import progress


@click.command()
@click.argument("scenario")
@click.option(
    "--guide",
    type=click.Choice(["path", "direct"]),
    help="Where sub-goals come from: a collision-free path, or none but the goal.  "
    "[default: what the scenario says, else path]",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Seed of the planner.  [default: what the scenario says, else 0]",
)
@output_option("--save", "RUN.npz", "Write the recorded run.")
@picture_options
@output_option("--json", "FILE", "Write the summary as JSON.")
def run(
    scenario: str,
    guide: str | None,
    seed: int | None,
    save: Path | None,
    html: Path | None,
    plot: Path | None,
    png: Path | None,
    gif: Path | None,
    json: Path | None,
) -> int:
    """Plan and simulate SCENARIO: a name of `densarm list`, or a TOML file.

    Prints how the run ended and what is proved about it. The exit status is 0 if the arm reached
    the goal and the whole motion is proved free of collision.

    \b
    Examples:
      densarm run swing_up --html swing_up.html
      densarm run panda_shelf --png panda_shelf.png --gif panda_shelf.gif
      densarm run my_scenario.toml --guide direct --save run.npz --json run.json
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.cli.report import print_run
        from densarm.closed_loop import simulate
        from densarm.outcome import Outcome
        from densarm.scenario import load_scenario

        with compiling_meanwhile():
            trajectory = simulate(load_scenario(scenario), guide, seed, on_progress=report)
        report("proving")
        certificate = trajectory.certificate
        report("writing")
        if save:
            trajectory.save(save)
        write_pictures(trajectory, html, plot, png, gif)
        if json:
            write_json(json, trajectory.summary())
    print_run(trajectory, certificate)
    proved = all(check.holds for check in certificate.checks if check.name == "swept")
    reached = trajectory.outcome == Outcome.REACHED
    return ExitStatus.SUCCESS if reached and proved else ExitStatus.FAILURE
