"""Two arms on one stand: links of both are checked against each other, and both move at once."""

import json
import re
import runpy
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.planning.plan import plan_motion
from densarm.world.configurations import clear_configurations
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return runpy.run_path(str(BENCHMARKS / "two_arms.py"))


def test_every_link_of_one_is_paired_with_every_link_of_the_other(script: Any) -> None:
    """By its hull or by pieces of it, which have its name and a number."""
    arm: Arm = script["two_arms"]()
    assert arm.nv == 12
    link = [item.name.split(".")[0] for item in arm.collision_model.geometryObjects]
    pairs = {
        frozenset((link[pair.first], link[pair.second]))
        for pair in arm.collision_model.collisionPairs
    }
    sides = ({name for name in link if name.startswith(side)} for side in ("left", "right"))
    apart = {frozenset(pair) for pair in product(*sides)}
    assert apart - pairs == {frozenset(("left_base_link_0", "right_base_link_0"))}  # both fixed


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["free", "table"])
def test_a_motion_of_both_is_proved_clear(script: Any, scene: str) -> None:
    arm = script["two_arms"]()
    world = World(arm, script["SCENES"][scene])
    start, goal = clear_configurations(world, 2, 3, script["MARGIN"])
    motion = plan_motion(world, start, goal)
    q = arm.configurations(motion.position)
    np.testing.assert_allclose(arm.difference(q[[0, -1]], np.array([start, goal])), 0.0, atol=3e-3)
    assert SweptCheck(world).check(q).verdict == SweptVerdict.CLEAR
    moved = np.ptp(motion.position, axis=0)
    assert (moved > 0.05).all()


@pytest.mark.slow
def test_numbers_of_each_scene_are_told(
    script: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "two.json"
    script["main"](["--scenes", "free", "--problems", "1", "--json", str(file)])
    (row,) = json.loads(file.read_text())["scenes"]["free"]
    assert row["outcome"] == "planned"
    assert re.search(r"free: \d+ pairs, 1 of 1 planned", capsys.readouterr().out)
