"""Random starts: curves of both swing-ups reach; with equal weights some are stuck."""

import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from densarm.density.navigation_density import DensityParameters
from densarm.scenarios.scenario import load_scenario
from densarm.world.configurations import clear_configurations

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def script() -> Any:
    return runpy.run_path(str(BENCHMARKS / "random_starts.py"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["swing_up", "three_link_swing_up"])
def test_curves_of_the_density_alone_reach(
    script: Any, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = load_scenario(name)
    starts = [scenario.start, *clear_configurations(scenario.world, 19, seed=0)]
    assert script["curves"](scenario, starts) == 20
    assert capsys.readouterr().out == "20 of 20 curves reach the goal; 1 left a critical point\n"


@pytest.mark.slow
def test_equal_weights_are_stuck_from_some(script: Any, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = replace(load_scenario("swing_up"), density=DensityParameters())
    starts = clear_configurations(scenario.world, 20, seed=0)
    assert 10 <= script["curves"](scenario, starts) < 20
    assert "maximum of the density" in capsys.readouterr().out
