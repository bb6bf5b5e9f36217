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

    Recorded beside them, at some of the samples, and never a reason to refuse: whether the energy
    of an unlimited regulation fell, and where Rantzer's condition held.

    \b
    Example:
      densarm run swing_up --save swing_up.npz
      densarm verify swing_up.npz
    """  # noqa: D301
    with progress() as report:
        report("proving")
        from densarm.cli.report import print_certificate, print_records
        from densarm.trajectory import Trajectory

        trajectory = Trajectory.load(run)
        certificate = trajectory.verify()
        energy, rantzer = trajectory.energy(), trajectory.rantzer()
        if json:
            records = {"energy": asdict(energy), "rantzer": asdict(rantzer)}
            proved = {"certified": certificate.certified, **asdict(certificate)}
            write_json(json, proved | {"recorded": records})
    print_certificate(certificate)
    print_records(energy, rantzer)
    return ExitStatus.SUCCESS if certificate.certified else ExitStatus.FAILURE
