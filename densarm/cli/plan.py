"""``densarm plan``: a trajectory for a robot that follows positions."""

from __future__ import annotations

import io
from csv import writer as csv_writer
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from densarm.cli.options import output_option, way_options
from densarm.cli.output import doubts, print_figures, progress, write_json
from densarm.errors import DensarmError, InvalidValueError
from densarm.values.files import atomic_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from densarm.planning.motion import MotionSamples


@click.command()
@click.argument("scenario")
@way_options
@click.option(
    "--period", type=float, default=0.01, show_default=True, help="Between two samples [s]."
)
@output_option("--csv", "FILE.csv", "Write time, positions, velocities and accelerations, in SI.")
@output_option("--json", "FILE.json", "Write them in the shape of ROS's JointTrajectory.")
def plan(
    scenario: str,
    guide: str | None,
    goal: Any,
    seed: int | None,
    period: float,
    csv: Path | None,
    json: Path | None,
) -> bool:
    """Plan SCENARIO alone: a name of `densarm list`, or a TOML file.

    Writes the trajectory for a robot that follows positions. The motion is proved clear, and so are
    the straight lines of joint space between its samples: a period at which they are not is
    refused. Obstacles that move are refused too, since a plan does not evade them. The exit status
    is 0 if there is a motion, 1 if none was found.

    \b
    Examples:
      densarm plan panda_shelf --csv panda_shelf.csv
      densarm plan ur5_bin --period 0.008 --csv ur5_bin.csv --json ur5_bin.json
    """  # noqa: D301
    with progress() as show:
        show("loading")
        from densarm.planning.motion import PlanningError
        from densarm.scenarios.run import plan as plan_scenario
        from densarm.scenarios.scenario import load_scenario, with_goal
        from densarm.values.checks import positive
        from densarm.values.kernels import on_compiling
        from densarm.world.separating_planes import SeparatingPlanes

        positive("period", period)
        chosen = load_scenario(scenario)
        if goal is not None:
            chosen = with_goal(chosen, "--goal", goal)
        if seed is not None:
            chosen = replace(chosen, seed=seed)
        if moving := [repr(item.name) for item in chosen.scene if item.motion is not None]:
            reason = "must stand, for a plan alone does not evade what moves (densarm run does)"
            raise DensarmError(f"{scenario}: {', '.join(moving)}: {reason}")
        show("planning")
        failure: PlanningError | None = None
        with on_compiling(lambda _: None) as compiled:
            try:
                motion = plan_scenario(chosen, guide)
            except PlanningError as error:
                failure = error
        if failure is None:
            samples, joints = motion.samples(period), chosen.arm.joint_names
            show("proving")
            if not SeparatingPlanes(chosen.world).polyline_is_clear(samples.position):
                allowed = "shorter: a straight line between two of its samples is not proved clear"
                raise InvalidValueError("period", period, allowed)
            tube = motion.tube
            if csv:
                _write_csv(csv, joints, samples)
            if json:
                write_json(json, samples.joint_trajectory(joints))
    click.echo(f"{chosen.title}\n")
    if failure is not None:
        click.secho(f"{failure.outcome}: {failure.outcome.description}", fg="red", bold=True)
        click.echo(failure.detail)
        return False
    click.secho("planned: The motion is proved clear, between its samples too.", fg="green")
    once = f"{compiled.seconds:.1f} s, once on this machine" if compiled.seconds else ""
    tubes = "" if tube is None else f"{tube.min():.2g} to {tube.max():.2g} rad or m, by the joint"
    print_figures(
        {
            "duration": f"{motion.duration:.3f} s, {len(samples.time)} samples",
            "planning": f"{motion.plan_time:.3f} s",
            "led by": motion.path.found_by if motion.path else "",
            "remark": motion.remark,
            "compiled": once,
            "may be off by": tubes or "nothing, as far as is proved",
            **doubts(chosen.task, chosen.world.base_overlaps()),
        }
    )
    return True


def _write_csv(path: Path, joints: Sequence[str], samples: MotionSamples) -> None:
    text = io.StringIO()
    writer = csv_writer(text, lineterminator="\n")
    kinds = ("position", "velocity", "acceleration")
    writer.writerow(["time", *(f"{kind}_{joint}" for kind in kinds for joint in joints)])
    for time, *rows in zip(*samples, strict=True):
        writer.writerow([float(time), *(float(value) for row in rows for value in row)])
    with atomic_file(path) as file:
        file.write(text.getvalue().encode())
