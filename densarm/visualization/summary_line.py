"""SummaryLine: what a page and a picture say of a run, in a few words."""

from dataclasses import dataclass

import numpy as np

from densarm.outcome import Outcome
from densarm.trajectory import Trajectory


@dataclass(frozen=True)
class SummaryLine:
    """Title, outcome, clearance and certificate of a run."""

    title: str
    outcome: str
    is_reached: bool
    facts: tuple[str, ...]
    """Duration and smallest clearance."""
    certificate: str
    is_certified: bool
    detail: str
    """What the outcome means, and what stood in the way."""

    @classmethod
    def of(cls, run: Trajectory) -> "SummaryLine":
        """Return the summary of a run."""
        smallest = float(run.clearance.min())
        clearance = _millimetres(smallest) if np.isfinite(smallest) else "infinite"
        return cls(
            title=run.scenario.title,
            outcome=str(run.outcome).replace("_", " "),
            is_reached=run.outcome == Outcome.REACHED,
            facts=(f"{run.time[-1]:.3f} s", f"smallest clearance {clearance}"),
            certificate="certified" if run.certified else "not certified",
            is_certified=run.certified,
            detail=f"{run.outcome.description} {run.detail}".strip(),
        )


def _millimetres(length: float) -> str:
    value = 1e3 * length
    return f"{value:.3g} mm" if abs(value) < 1e3 else f"{value:.0f} mm"
