"""``densarm list``: robots and scenarios."""

import click

from densarm.catalogue import read_toml, robot_names, scenario_paths
from densarm.cli.exit_status import ExitStatus


@click.command("list")
def list_known() -> int:
    """List the robots and scenarios that come with densarm.

    \b
    Example:
      densarm list
    """  # noqa: D301
    scenarios = {name: read_toml(path) for name, path in scenario_paths().items()}
    width = max(len(name) for name in [*robot_names(), *scenarios]) + 2
    click.echo("Robots, for load_arm and [robot] name:")
    for name in robot_names():
        click.echo(f"  {name}")
    click.echo("\nScenarios, for densarm run:")
    for name, data in scenarios.items():
        click.echo(f"  {name:<{width}}{data.get('title', '')}")
    return ExitStatus.SUCCESS
