"""``densarm list``: robots and scenarios."""

from dataclasses import replace

import click


@click.command("list")
def list_known() -> None:
    """List the robots and scenarios that come with densarm.

    Pairs are the geometry pairs whose distances are computed, of the robot with itself and with
    the scenario's obstacles. Two links that move against each other are left out where they are
    neighbours, where the robot's SRDF says so, and where they always collide; in Python,
    `load_arm(name).excluded_pairs` tells which and why. Links count as one hull each; of those that
    are made of convex pieces more pairs are queried, and fewer left out.

    \b
    Example:
      densarm list
    """  # noqa: D301
    from densarm.arms.catalogue import robot_description, robot_names, scenario_paths
    from densarm.arms.models import robot_outline
    from densarm.scene.loading import parse_scene
    from densarm.values.files import read_toml

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
        data = read_toml(path)
        scene = parse_scene(path.parent, data.get("scene", ""), data["obstacles"])
        robot = data["robot"]["name"]
        arm = robot_outline(replace(robot_description(robot), attachments=scene.attachments))
        others = arm.n_moving_shapes * sum(len(body.convex_shapes()) for body in scene)
        counts = f"{arm.n_joints:>6}  {arm.n_pairs:>10}  {others:>6}"
        click.echo(f"  {name:<{name_width}}{robot:<{robot_width}}{counts}")
        click.echo(f"    {data['title']}")
