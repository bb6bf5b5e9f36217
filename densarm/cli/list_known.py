"""``densarm list``: robots and scenarios."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from densarm.cli.exit_status import ExitStatus

if TYPE_CHECKING:
    from pathlib import Path

    from densarm.robot.outline import RobotOutline


@click.command("list")
def list_known() -> int:
    """List the robots and scenarios that come with densarm.

    Pairs are the geometry pairs whose distances are computed, of the robot with itself and with
    the scenario's obstacles. Two links that move against each other are left out where they are
    neighbours, where the robot's SRDF says so, and where they always collide; in Python,
    `load_arm(name).excluded_pairs` tells which and why.

    \b
    Example:
      densarm list
    """  # noqa: D301
    from densarm.catalogue import robot_description, robot_names, scenario_paths
    from densarm.robot.outline import robot_outline

    robots, scenarios = robot_names(), scenario_paths()
    name_width = max(map(len, [*robots, *scenarios])) + 2
    robot_width = max(map(len, robots)) + 2
    click.echo("Robots, for load_arm and [robot] name:")
    click.echo(f"  {'':<{name_width}}joints  self pairs  left out")
    for name in robots:
        arm = robot_outline(robot_description(name))
        counts = f"{arm.n_joints:>6}  {arm.n_pairs:>10}  {arm.n_excluded:>8}"
        click.echo(f"  {name:<{name_width}}{counts}")
    click.echo("\nScenarios, for densarm run:")
    click.echo(f"  {'':<{name_width}}{'robot':<{robot_width}}joints  self pairs  others")
    for name, path in scenarios.items():
        title, robot, arm, others = _outline(path)
        counts = f"{arm.n_joints:>6}  {arm.n_pairs:>10}  {others:>6}"
        click.echo(f"  {name:<{name_width}}{robot:<{robot_width}}{counts}")
        click.echo(f"    {title}")
    return ExitStatus.SUCCESS


def _outline(path: Path) -> tuple[str, str, RobotOutline, int]:
    """Return a known scenario's title, robot, its outline, and the pairs with obstacles."""
    from densarm.catalogue import read_toml, robot_description
    from densarm.robot.outline import robot_outline
    from densarm.scene_files.scene_tables import parse_scene

    data = read_toml(path)
    scene = parse_scene(path.parent, data.get("scene", ""), data["obstacles"])
    robot = data["robot"]["name"]
    arm = robot_outline(replace(robot_description(robot), attachments=scene.attachments))
    shapes = sum(len(obstacle.convex_shapes()) for obstacle in scene)
    return data["title"], robot, arm, shapes * arm.n_moving_shapes
