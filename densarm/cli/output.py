"""What commands leave: progress, JSON, pictures, tables, and reports in words."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from densarm.values.files import atomic_file, on_waiting
from densarm.values.outcome import Outcome

if TYPE_CHECKING:
    from pathlib import Path

    from densarm.certificates.certificate import Certificate
    from densarm.certificates.records import EnergyRecord, RantzerRecord
    from densarm.certificates.task import Task
    from densarm.simulation.run import Run

_COLUMN = 18  # characters
_WIDTH = 110  # characters of a table, at least, so that no number is cut


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Give a function that shows a phrase until the next one; it shows nothing off a terminal."""
    if not sys.stdout.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    with Console().status("starting") as status, on_waiting(status.update):
        yield status.update


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write JSON data, without infinities and NaN, to a file, whole or not at all.

    Raises:
        FileContentError: the file cannot be written.
    """
    text = json.dumps(data, indent=2, allow_nan=False)
    with atomic_file(path) as file:
        file.write(f"{text}\n".encode())


def write_pictures(run: Run, html: Any, plot: Any, png: Any, gif: Any) -> None:
    """Write the files that `picture_options` asked for, by their paths or None.

    Raises:
        FileContentError: a file cannot be written.
    """
    import densarm  # which imports matplotlib and meshcat, that take a second, when they are used

    if html:
        densarm.save_html(run, html)
    if plot:
        densarm.save_plot(run, plot)
    if png:
        densarm.save_picture(run, png)
    if gif:
        densarm.save_animation(run, gif)


def print_table(rows: Sequence[Mapping[str, str]], caption: str, title: str | None = None) -> None:
    """Print a table of texts by their headings, without columns in which there is none."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=title,
        caption=caption,
        box=SIMPLE,
        padding=0,
        show_edge=False,
        title_justify="left",
        caption_justify="left",
    )
    first, *others = shown = [heading for heading in rows[0] if any(row[heading] for row in rows)]
    table.add_column(first, no_wrap=True)
    for heading in others:
        table.add_column(Text(heading), justify="right")
    for row in rows:
        table.add_row(*(row[heading] for heading in shown))
    Console(width=max(Console().width, _WIDTH), highlight=False).print(table)


def print_run(run: Run, compiled: float) -> None:
    """Print how a run ended, its figures and what is proved about it.

    Args:
        run: the run.
        compiled: time that compiling kernels took meanwhile [s].
    """
    color = "green" if run.outcome == Outcome.REACHED else "red"
    click.echo(f"{run.task.title}\n")
    click.secho(f"{run.outcome}: {run.outcome.description}", fg=color, bold=True)
    if run.detail:
        click.echo(run.detail)
    click.echo()
    smallest, by_velocity = float(run.clearance.min()), run.task.input == "velocity"
    figures = {
        "duration": f"{run.time[-1]:.3f} s",
        "min clearance": f"{smallest * 1e3:.4g} mm" if math.isfinite(smallest) else "no pairs",
        "goal error": "no goal" if run.task.goal is None else f"{run.goal_error:.2g} rad",
        "peak torque": (
            "none, velocities are commanded"
            if by_velocity
            else f"{run.peak_torque_ratio:.0%} of the limits"
        ),
        "planning": f"{run.plan_time:.3f} s, ready after {run.preparation_time:.2f} s",
        "led by": run.led_by + (f"; alone it is stuck: {run.stuck}" if run.stuck else ""),
        "remark": run.remark,
        "compiled": f"{compiled:.1f} s, once on this machine" if compiled > 0.0 else "",
        "planned again": ", ".join(f"at t = {time:.3f} s" for time in run.replanned_at),
    }
    if run.task.plant != "pinocchio" or run.task.disturbances:
        told = ", ".join(f"{name} {value}" for name, value in run.task.disturbances.items())
        figures["plant"] = f"{run.task.plant}, {told or 'undisturbed'}"
    if run.tracking_error is not None:
        figures["tracking error"] = f"{run.tracking_error:.2g} rad"
    print_figures(figures | doubts(run.task, run.base_overlaps))
    click.echo()
    print_certificate(run.certificate)


def doubts(task: Task, base_overlaps: Sequence[str]) -> dict[str, str]:
    """Return what of arm and scene may not be as it was meant, by labels of `print_figures`."""
    found = {"robot": "; ".join(task.arm.remarks)}
    if base_overlaps:
        found["not checked"] = f"{'; '.join(base_overlaps)}: neither moves"
    if large := task.large_meshes:
        sides = ", ".join(f"{name} {side:.3g} m" for name, side in large.items())
        found["large meshes"] = f"{sides}: is their unit right?"
    return found


def print_figures(figures: Mapping[str, str]) -> None:
    """Print texts by their labels, one a line, without those that are empty."""
    for label, value in figures.items():
        if value:
            click.echo(f"{label:<{_COLUMN}}{value}")


def print_certificate(certificate: Certificate) -> None:
    """Print each check of a certificate and whether it holds."""
    within = f", {certificate.within}" if certificate.within else ""
    click.echo(f"{'certified':<{_COLUMN}}{_verdict(certificate.certified)}{within}")
    for check in certificate.checks:
        click.echo(f"  {check.name:<{_COLUMN - 2}}{_verdict(check.holds)}  {check.detail}")


def print_records(energy: EnergyRecord, rantzer: RantzerRecord) -> None:
    """Print what is recorded of a run without being a part of its certificate."""
    found = "not applicable: no sample away from goal and contact"
    if rantzer.share is not None:
        found = (
            f"holds at {rantzer.share:.0%} of {rantzer.samples} samples (gauge {rantzer.gauge}, "
            f"plain density), smallest value {rantzer.smallest:.3g} at t = {rantzer.time:.3f} s"
        )
    click.echo("recorded, not certified")
    click.echo(f"  {'energy':<{_COLUMN - 2}}{energy.verdict}: {energy.detail}")
    click.echo(f"  {'Rantzer':<{_COLUMN - 2}}{found}")


def _verdict(holds: bool | None) -> str:
    if holds is None:
        return "–  "
    return click.style("yes", fg="green") if holds else click.style("no ", fg="red")
