"""``densarm list``: robots and scenarios."""

import click

from densarm.cli.exit_status import ExitStatus


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
    from densarm.arm import load_arm
    from densarm.catalogue import robot_names, scenario_paths
    from densarm.clearance import Clearance
    from densarm.scenario import load_scenario

    robots, scenarios = robot_names(), scenario_paths()
    name_width = max(map(len, [*robots, *scenarios])) + 2
    robot_width = max(map(len, robots)) + 2
    # Printed row by row, since the meshes of all robots take seconds to load.
    click.echo("Robots, for load_arm and [robot] name:")
    click.echo(f"  {'':<{name_width}}joints  self pairs  left out")
    for name in robots:
        arm = load_arm(name)
        own, left_out = len(arm.collision_model.collisionPairs), len(arm.excluded_pairs)
        click.echo(f"  {name:<{name_width}}{arm.nv:>6}  {own:>10}  {left_out:>8}")
    click.echo("\nScenarios, for densarm run:")
    click.echo(f"  {'':<{name_width}}{'robot':<{robot_width}}joints  self pairs  others")
    for name in scenarios:
        scenario = load_scenario(name)
        arm = scenario.arm
        own = len(arm.collision_model.collisionPairs)
        others = Clearance(arm, scenario.scene).n_pairs - own
        counts = f"{arm.nv:>6}  {own:>10}  {others:>6}"
        click.echo(f"  {name:<{name_width}}{arm.name:<{robot_width}}{counts}")
        click.echo(f"    {scenario.title}")
    return ExitStatus.SUCCESS
