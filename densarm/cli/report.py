"""Reports in words: the summary of a run and the checks of a certificate."""

import click
import numpy as np

from densarm.certificates.certificate import Certificate
from densarm.certificates.energy import EnergyRecord
from densarm.certificates.rantzer import RantzerRecord
from densarm.outcome import Outcome
from densarm.trajectory import Trajectory

_COLUMN = 18  # characters


def print_run(run: Trajectory, certificate: Certificate) -> None:
    """Print how a run ended, its figures and what is proved about it."""
    color = "green" if run.outcome == Outcome.REACHED else "red"
    click.echo(f"{run.scenario.title}\n")
    click.secho(f"{run.outcome}: {run.outcome.description}", fg=color, bold=True)
    if run.detail:
        click.echo(run.detail)
    click.echo()
    for label, value in _figures(run).items():
        click.echo(f"{label:<{_COLUMN}}{value}")
    click.echo()
    print_certificate(certificate)


def print_certificate(certificate: Certificate) -> None:
    """Print each check of a certificate and whether it holds."""
    click.echo(f"{'certified':<{_COLUMN}}{_verdict(certificate.certified)}")
    for check in certificate.checks:
        click.echo(f"  {check.name:<{_COLUMN - 2}}{_verdict(check.holds)}  {check.detail}")


def print_records(energy: EnergyRecord, rantzer: RantzerRecord) -> None:
    """Print what is recorded of a run without being a part of its certificate."""
    click.echo("recorded, not certified")
    click.echo(f"  {'energy':<{_COLUMN - 2}}{energy.verdict}: {energy.detail}")
    click.echo(f"  {'Rantzer':<{_COLUMN - 2}}{_rantzer(rantzer)}")


def _rantzer(record: RantzerRecord) -> str:
    if record.share is None:
        return "not applicable: no sample away from goal and contact"
    return (
        f"holds at {record.share:.0%} of {record.samples} samples (gauge {record.gauge}, plain "
        f"density), smallest value {record.smallest:.3g} at t = {record.time:.3f} s"
    )


def _figures(run: Trajectory) -> dict[str, str]:
    smallest = float(run.clearance.min())
    figures = {
        "duration": f"{run.time[-1]:.3f} s",
        "min clearance": f"{smallest * 1e3:.4g} mm" if np.isfinite(smallest) else "no pairs",
        "goal error": f"{run.goal_error:.2g} rad",
        "peak torque": f"{run.peak_torque_ratio:.0%} of the limits",
        "planning": f"{run.plan_time:.3f} s, ready after {run.preparation_time:.2f} s",
    }
    if run.tracking_error is not None:
        figures["tracking error"] = f"{run.tracking_error:.2g} rad"
    if run.replanned_at:
        figures["planned again"] = ", ".join(f"at t = {time:.3f} s" for time in run.replanned_at)
    return figures


def _verdict(holds: bool) -> str:
    return click.style("yes", fg="green") if holds else click.style("no ", fg="red")
