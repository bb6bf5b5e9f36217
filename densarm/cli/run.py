"""``densarm run``: plan and simulate a scenario."""

from pathlib import Path
from typing import Any

import click

from densarm.cli.first_run import compiling_meanwhile
from densarm.cli.options import output_option, picture_options, plant_options, way_options
from densarm.cli.output import print_run, progress, write_json, write_pictures


@click.command()
@click.argument("scenario")
@way_options
@plant_options
@click.option("--viewer", is_flag=True, help="Show it in MuJoCo's viewer while it runs.")
@output_option("--save", "RUN.npz", "Write the recorded run.")
@picture_options
@output_option("--json", "FILE", "Write the summary as JSON.")
def run(
    scenario: str,
    guide: str | None,
    goal: Any,
    seed: int | None,
    plant: str | None,
    disturb: dict[str, Any],
    viewer: bool,
    save: Path | None,
    json: Path | None,
    **pictures: Path | None,
) -> bool:
    """Plan and simulate SCENARIO: a name of `densarm list`, or a TOML file.

    Prints how the run ended and what is proved about it. The exit status is 0 if the arm reached
    the goal and the whole motion is proved free of collision.

    \b
    Examples:
      densarm run swing_up --html swing_up.html
      densarm run panda_shelf --png panda_shelf.png --gif panda_shelf.gif
      densarm run panda_table --plant mujoco --disturb payload=1 --disturb coulomb=0.5
      densarm run panda_table --goal '{frame = "panda_hand_tcp", position = [0.6, -0.2, 0.5]}'
      densarm run my_scenario.toml --guide direct --save run.npz --json run.json
    """  # noqa: D301
    with progress() as show:
        doing = "loading"
        show(doing)
        from densarm.scenarios.run import run as run_scenario
        from densarm.scenarios.scenario import load_scenario, with_goal
        from densarm.simulation.disturbances import Disturbances
        from densarm.simulation.mujoco_plant import MujocoPlant
        from densarm.values.kernels import on_compiling
        from densarm.values.outcome import Outcome
        from densarm.values.tables import parse_table

        def report(phrase: str) -> None:
            nonlocal doing
            doing = phrase
            show(doing)

        def compiling(begins: bool) -> None:
            show("compiling, once on this machine" if begins else doing)

        with on_compiling(compiling) as compiled, compiling_meanwhile():
            chosen = load_scenario(scenario)
            if goal is not None:
                chosen = with_goal(chosen, "--goal", goal)
            told = parse_table(
                "disturbances", Disturbances, {**chosen.disturbances.given, **disturb}
            )
            driven: MujocoPlant | str | None = plant
            if viewer:
                driven = MujocoPlant(chosen.world, chosen.simulation.dt, told)
                driven.view()
            done = run_scenario(chosen, guide, seed, report, plant=driven, disturbances=told)
            report("proving")
            certificate = done.certificate
            report("writing")
            if save:
                done.save(save)
            write_pictures(done, **pictures)
            if json:
                write_json(json, done.summary())
    print_run(done, compiled.seconds)
    proved = all(check.holds for check in certificate.checks if check.name == "swept")
    return done.outcome == Outcome.REACHED and proved
