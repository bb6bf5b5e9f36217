"""The scripts beyond the paper's figures, with few starts: what their numbers must say."""

import json
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

SCRIPTS = Path(__file__).parents[2] / "examples" / "paper"

RunMain = Callable[..., dict[str, Any]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunMain:
    """Return a runner of a script's main with few starts and other constants: its result."""
    monkeypatch.syspath_prepend(str(SCRIPTS))

    def run_main(name: str, starts: int, pictures: list[str], **constants: Any) -> dict[str, Any]:
        main = runpy.run_path(str(SCRIPTS / f"{name}.py"))["main"]
        main.__globals__.update(constants)
        main(["--out", str(tmp_path), "--starts", str(starts)])
        for picture in pictures:
            for kind in ("png", "pdf"):
                assert (tmp_path / f"{picture}.{kind}").stat().st_size > 10_000
        text = (tmp_path / "result.json").read_text(encoding="utf-8")
        result: dict[str, Any] = json.loads(text)
        return result

    return run_main


def test_slower_obstacles_enter_none_and_faster_ones_some(run: RunMain) -> None:
    result = run(
        "moving_scene",
        16,
        ["moving_scene"],
        SLOW=(0.5,),
        FAST=(3.0,),
        DT=0.08,
        HELD_ERROR=0.3**2 * 0.08 / 4.0,
        DURATION=16.0,
        UNBOUNDED_DURATION=8.0,
    )
    assert result["holds"] is True
    by_speed = result["numbers"]["by_obstacle_speed_per_u_max"]
    assert by_speed["0.5"]["entered"] == 0
    assert by_speed["3.0"]["entered"] > 0
    assert result["numbers"]["unbounded_control_in_continuous_time"]["entered"] == 0


def test_where_rantzers_condition_holds_everywhere_starts_enter(run: RunMain) -> None:
    result = run(
        "rantzer",
        40,
        ["rantzer_maps", "rantzer_shares"],
        SIDE=80,
        MAPPED=(1.0, 25.0),
        ALPHAS=(1.0, 5.0, 1000.0),
        THETAS=(0.0, 0.1),
    )
    assert result["holds"] is False
    numbers = result["numbers"]
    assert numbers["free_space_largest_difference_from_closed_form"] < 1e-6
    assert numbers["smallest_alpha_where_it_holds_everywhere"] == {
        "theta 0": None,
        "theta 0.1": 1000.0,
    }
    assert numbers["fewest_starts_that_enter_where_it_holds_everywhere"] > 0
    standing = numbers["density_gauge_by_theta_and_alpha"]["theta 0"].values()
    assert [each["entered"] for each in standing] == [0, 0, 0]


def test_distances_hold_but_for_a_region_that_does_not_enclose_its_set(run: RunMain) -> None:
    main = runpy.run_path(str(SCRIPTS / "assumptions.py"))
    chosen = [each for each in main["scenes"]() if each.name in ("3", "5, r = 2.5")]
    result = run(
        "assumptions",
        20,
        ["assumptions_table", "assumptions_occupancy"],
        scenes=lambda: chosen,
        SIDE={2: 100},
        THETAS=(0.1, 1.0),
    )
    assert result["holds"] is False
    circle, c_shape = result["numbers"]["scenes"].values()
    assert circle["zeta_m"] == pytest.approx(1.0, abs=1e-6)
    assert circle["theta_allowed_for_epsilon"] == pytest.approx(0.09 / 12.566, rel=0.02)
    assert c_shape["zeta_m"] == 0.0
    assert c_shape["largest_psi_slope_per_m"] is None
    for scene in (circle, c_shape):
        for by_theta in scene["by_theta"].values():
            assert by_theta["outside_entered"] == 0
        assert scene["by_theta"]["0"]["sensed_entered"] == 0
        assert scene["by_theta"]["1"]["sensed_entered"] > 0
