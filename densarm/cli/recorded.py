"""``densarm view`` and ``densarm verify``: what a recorded run shows, and what it proves."""

from dataclasses import asdict
from pathlib import Path

import click

from densarm.cli.options import output_option, picture_options
from densarm.cli.output import (
    print_certificate,
    print_records,
    progress,
    write_json,
    write_pictures,
)


@click.command()
@click.argument("run", metavar="RUN.npz")
@picture_options
def view(run: str, **pictures: Path | None) -> None:
    """Show a recorded run: in the browser until Ctrl-C, or as files.

    Without options a page opens that plays the run in real time, with play, pause and a time line.
    With options it writes the files that they name and ends.

    \b
    Examples:
      densarm run swing_up --save swing_up.npz
      densarm view swing_up.npz
      densarm view swing_up.npz --gif swing_up.gif
    """  # noqa: D301
    from densarm.simulation.run import Run

    loaded = Run.load(run)
    if any(pictures.values()):
        write_pictures(loaded, **pictures)
        return
    from densarm.visualization.html_page import view as show

    show(loaded, on_url=lambda url: click.echo(f"{url}  (Ctrl-C ends)"))


@click.command()
@click.argument("run", metavar="RUN.npz")
@output_option("--json", "FILE", "Write the checks as JSON.")
def verify(run: str, json: Path | None) -> bool:
    """Prove from its record alone that a run is what it says.

    The checks: the swept volume of the whole motion touches neither obstacles nor the arm itself
    (swept), it begins at the start and ends at rest at the goal (start, goal), inside all limits
    (limits), each recorded torque leads from each state to the next (replay), and from every state
    the arm can stop along a straight line, inside the limits and in free space (stopping). Replay
    does not apply to a plant that the record says is disturbed, or MuJoCo's. The exit status is 0
    if all hold that apply.

    Recorded beside them, at some of the samples, and never a reason to refuse: whether the energy
    of an unlimited regulation fell, and where Rantzer's condition held.

    \b
    Example:
      densarm run swing_up --save swing_up.npz
      densarm verify swing_up.npz
    """  # noqa: D301
    with progress() as report:
        report("proving")
        from densarm.scenarios.run import records
        from densarm.simulation.run import Run

        loaded = Run.load(run)
        certificate = loaded.certificate
        energy, rantzer = records(loaded)
        if json:
            recorded = {"energy": asdict(energy), "rantzer": asdict(rantzer)}
            proved = {"certified": certificate.certified, **asdict(certificate)}
            write_json(json, proved | {"recorded": recorded})
    print_certificate(certificate)
    print_records(energy, rantzer)
    return certificate.certified
