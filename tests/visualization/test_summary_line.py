from dataclasses import replace

import numpy as np
import pytest

from densarm.outcome import Outcome
from densarm.visualization.summary_line import SummaryLine


def test_reached_and_certified(swing_up_run):
    summary = SummaryLine.of(swing_up_run)
    assert summary.is_reached
    assert summary.is_certified
    assert summary.certificate == "certified"
    assert summary.title == swing_up_run.scenario.title


@pytest.mark.parametrize(
    ("clearance", "expected"),
    [(0.00316227, "3.16 mm"), (1.25, "1250 mm"), (-0.001, "-1 mm"), (np.inf, "infinite")],
)
def test_failed_run(resting, clearance, expected):
    run = replace(resting, clearance=np.array([clearance]), outcome=Outcome.NO_PATH)
    summary = SummaryLine.of(run)
    assert summary.outcome == "no path"
    assert not summary.is_reached
    assert summary.facts == ("0.000 s", f"smallest clearance {expected}")
    assert summary.detail == f"{Outcome.NO_PATH.description} late"
