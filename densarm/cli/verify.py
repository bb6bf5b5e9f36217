"""``densarm verify``: what is proved about a recorded run."""

from dataclasses import asdict
from pathlib import Path

import click

from densarm.cli.exit_status import ExitStatus
from densarm.cli.json_file import write_json
from densarm.cli.output_option import output_option
from densarm.cli.progress import progress


@click.command()
@click.argument("run", metavar="RUN.npz")
@output_option("--json", "FILE", "Write the checks as JSON.")
def verify(run: str, json: Path | None) -> int:
    """Prove from its record alone that a run is what it says.

    The checks: the swept volume of the whole motion touches neither obstacles nor the arm itself
    (swept), it begins at the start and ends at rest at the goal (start, goal), inside all limits
    (limits), each recorded torque leads from each state to the next (replay), and from every state
    a straight brake inside the limits ends in free space (stopping). The exit status is 0 if all
    of them hold.

    \b
    Example:
      densarm run swing_up --save swing_up.npz
      densarm verify swing_up.npz
    """  # noqa: D301
    with progress() as report:
        report("proving")
        from densarm.cli.report import print_certificate
        from densarm.trajectory import Trajectory

        certificate = Trajectory.load(run).verify()
        if json:
            write_json(json, {"certified": certificate.certified, **asdict(certificate)})
    print_certificate(certificate)
    return ExitStatus.SUCCESS if certificate.certified else ExitStatus.FAILURE
