"""``densarm bench``: benchmarks."""

from pathlib import Path

import click

from densarm.cli.exit_status import ExitStatus
from densarm.cli.json_file import write_json
from densarm.cli.output_option import output_option
from densarm.cli.progress import progress


@click.group(no_args_is_help=False)
def bench() -> None:
    """Measure densarm on this machine.

    \b
    Example:
      densarm bench step --arm panda --shapes hull --pairs 64 --json step.json
    """  # noqa: D301


@bench.command()
@click.option("--arm", default="panda", show_default=True, help="A name of `densarm list`.")
@click.option(
    "--shapes",
    type=click.Choice(["hull", "capsule"]),
    default="hull",
    show_default=True,
    help="The arm's collision geometry.",
)
@click.option(
    "--pairs",
    type=click.IntRange(min=1),
    default=64,
    show_default=True,
    help="Geometry pairs: arm to sphere, filled up by the arm's own.",
)
@output_option("--json", "FILE", "Write the result as JSON.")
def step(arm: str, shapes: str, pairs: int, json: Path | None) -> int:
    """Time one control step of the density tracking controller.

    The whole `controller.torque` is compared with the bare calls of Pinocchio and coal that it
    cannot do without (computeJointJacobians, updateGeometryPlacements, computeDistances, rnea) on
    the same pairs and states, in turns. Times are medians.

    \b
    Example:
      densarm bench step --arm panda --shapes capsule --pairs 64 --json step.json
    """  # noqa: D301
    with progress() as report:
        report("measuring")
        from densarm.bench.step import time_step

        result = time_step(arm, shapes, pairs)
        if json:
            write_json(json, result.to_json())
    click.echo(f"controller.torque  {result.step_us:.1f} µs")
    click.echo(f"bare calls         {result.bare_us:.1f} µs")
    click.echo(f"ratio              {result.ratio:.2f}")
    click.echo(f"pairs              {result.pairs}")
    return ExitStatus.SUCCESS
