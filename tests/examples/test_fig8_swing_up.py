import json
import runpy
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "examples" / "paper" / "fig8_swing_up.py"


def test_swing_up_without_a_planner(tmp_path):
    script = runpy.run_path(str(SCRIPT))
    script["main"](["--out", str(tmp_path), "--starts", "6"])
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"fig8_swing_up.png", "fig8_swing_up.pdf", "result.json"}
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert set(result) == {"figure", "claim", "holds", "numbers"}
    assert result["figure"] == "Fig. 8"
    assert result["holds"]
    numbers = result["numbers"]
    assert numbers["planning_system"]["reached"] == 6
    assert numbers["runs_by_torque_reached"] == numbers["runs_by_torque"] == 6
    assert numbers["swing_up_smallest_clearance_m"] > 0.05
    assert numbers["traps_on_rims_inertia_weights"] == 0
    assert numbers["traps_on_rims_equal_weights"] > 0
    assert numbers["other_densities"]["cover, sum with equal weights"]["reached"] < 7
