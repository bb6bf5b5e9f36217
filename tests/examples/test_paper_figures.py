"""Every figure's script, with few starts: it writes its pictures, and its claim holds."""

import json
import runpy
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.shapes import Ball, Ellipsoid
from densarm.values.arrays import Array
from densarm.visualization.figure_style import plane_grid

SCRIPTS = Path(__file__).parents[2] / "examples" / "paper"
STARTS = {
    "fig1_occupancy": 6400,
    "fig2_inverse_bumps": 1,
    "fig3_saddle": 300,
    "fig4_complex_environments": 10,
    "fig5_c_shape": 50,
    "fig6_bounded_control": 20,
    "fig7_control_noise": 20,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STARTS)
def test_claim_holds(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCRIPTS))
    main = runpy.run_path(str(SCRIPTS / f"{name}.py"))["main"]
    main(["--out", str(tmp_path), "--starts", str(STARTS[name])])
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["figure"] == f"Fig. {name[3]}"
    assert result["holds"] is True
    assert result["departures"]
    for kind in ("png", "pdf"):
        assert (tmp_path / f"{name}.{kind}").stat().st_size > 10_000


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], SimpleNamespace]:
    monkeypatch.syspath_prepend(str(SCRIPTS))
    return lambda name: SimpleNamespace(**runpy.run_path(str(SCRIPTS / f"{name}.py")))


@pytest.mark.parametrize(
    ("shape", "first_to_fail"),
    [("CLOSED_C", "density, r = 4.5"), ("SHALLOW_C", "navigation function, κ = 1")],
)
def test_fig_5_fails_where_the_density_does_and_where_the_others_do_not(
    load: Callable[[str], SimpleNamespace], shape: str, first_to_fail: str
) -> None:
    script = load("fig5_c_shape")
    fields = script.fields(getattr(script, shape))
    reached = {name: script.rates(field, 10)["reached"] for name, field in fields.items()}
    assert reached[first_to_fail] == (0 if first_to_fail == script.ENCLOSING else 10)
    assert not script.holds(reached, 10)


def test_fig_5_verdict_needs_both_sides(load: Callable[[str], SimpleNamespace]) -> None:
    script = load("fig5_c_shape")
    reached = dict.fromkeys(script.FIELDS, 3) | {script.ENCLOSING: 10}
    assert script.holds(reached, 10)
    assert not script.holds(reached | {script.ENCLOSING: 9}, 10)
    assert not script.holds(reached | {"density, r = 2.5": 10}, 10)


def straight_bump(h: Array, s: Array, theta: float) -> Array:
    """Right on both rims, and between them with a corner at each."""
    return np.clip(h / (h - s), 0.0, 1.0) + theta


@pytest.mark.parametrize("fault", ["corners", "uncovered", "none"])
def test_fig_2_fails_by_a_bump_with_corners_and_by_a_region_that_leaves_a_part_out(
    load: Callable[[str], SimpleNamespace], fault: str
) -> None:
    script = load("fig2_inverse_bumps")
    region = next(iter(script.REGIONS.values()))
    if fault == "corners":
        script.checks.__globals__["inverse_bump"] = straight_bump
    if fault == "uncovered":
        region = UnsafeRegion(h=Ball(1.0), s=Ellipsoid((2.5, 0.8), 2.0))
    x = np.stack(plane_grid(script.EXTENT, 200), axis=-1).reshape(-1, 2)
    assert script.is_inverse_bump(script.checks(region, x, 10)) == (fault == "none")
