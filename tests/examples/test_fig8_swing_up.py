import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import densarm
from densarm.density.goal_distance import TorusDistance
from densarm.density.joint_space_cover import Ellipsoid

SCRIPT = Path(__file__).parents[2] / "examples" / "paper" / "fig8_swing_up.py"
ARM = densarm.load_arm("two_link")
GOAL = ARM.configuration([1.5, 0.0])
SUM = TorusDistance(ARM, kappa=np.inf)


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPT.parent))
        return runpy.run_path(str(SCRIPT))


def ellipse(first: float, second: float) -> Ellipsoid:
    return Ellipsoid(np.zeros(2), np.diag([first**2, second**2]))


def test_rim_is_on_the_ellipse(script: dict[str, Any]) -> None:
    body = Ellipsoid(np.array([1.0, 2.0]), np.array([[1.0, 0.6], [0.6, 0.5]]))
    np.testing.assert_allclose(body.level(script["rim"](body, 50)), 1.0)


def test_a_circle_before_the_goal_has_no_trap(script: dict[str, Any]) -> None:
    assert script["rim_traps"](ellipse(0.5, 0.5), SUM, GOAL).shape == (0, 2)


def test_a_wall_before_the_goal_has_one_where_it_faces_away_from_the_goal(
    script: dict[str, Any],
) -> None:
    (trap,) = script["rim_traps"](ellipse(0.1, 2.0), SUM, GOAL)
    np.testing.assert_allclose(trap, [-0.1, 0.0], atol=1e-2)


def test_weights_that_flatten_the_level_sets_of_the_goal_distance_free_a_wall(
    script: dict[str, Any],
) -> None:
    tilt = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    wall = Ellipsoid(np.zeros(2), (tilt * np.array([0.04, 2.0])) @ tilt.T)
    weighted = TorusDistance(ARM, [8.0, 1.0], np.inf)
    assert len(script["rim_traps"](wall, SUM, GOAL)) == 1
    assert len(script["rim_traps"](wall, weighted, GOAL)) == 0


@pytest.mark.slow
def test_swing_up_without_a_planner(script: dict[str, Any], tmp_path: Path) -> None:
    script["main"](["--out", str(tmp_path), "--starts", "6"])
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"fig8_swing_up.png", "fig8_swing_up.pdf", "result.json"}
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert set(result) == {"figure", "claim", "holds", "numbers", "departures"}
    assert result["figure"] == "Fig. 8"
    assert result["holds"]
    numbers = result["numbers"]
    assert numbers["planning_system"]["reached"] == 6
    assert numbers["runs_by_torque_reached"] == numbers["runs_by_torque"] == 6
    assert numbers["swing_up_smallest_clearance_m"] > 0.05
    assert numbers["traps_on_rims_inertia_weights"] == 0
    assert numbers["traps_on_rims_equal_weights"] > 0
    others = numbers["other_densities"]
    assert others["cover, sum with equal weights"]["reached"] < 7
    assert others["cover, the paper's V with its brackets as printed"]["reached"] == 0
    assert numbers["torque_of_eq_17_as_printed_one_step_from_e_0_nm"] > 1e12
