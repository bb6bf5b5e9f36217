"""Balls aimed at an arm: trials that are kept, what is told of velocities, laws that differ."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.control.evasion import EVADING_GAIN, Evasion
from densarm.errors import DensarmError
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study import moving
from densarm.study.evasions import MARGIN, RATE, CbfpyEvasion, DamperEvasion, MinkEvasion
from densarm.study.moving import Cell, draw_trial, run_trial, run_trials
from densarm.world.active_pairs import ActivePairs
from densarm.world.world import World

STILL = ConstantVelocity(linear=(0.0, 0.0, 0.0))
CELL = Cell("panda", 1, 0.5, resting=True, estimated=True)


@pytest.fixture(scope="module")
def panda() -> Arm:
    return load_arm("panda", shapes="capsule")


def test_trials_that_are_kept_are_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def run(cell: Cell, items: list[tuple[int, str]]) -> dict[tuple[int, str], moving._End]:  # noqa: ARG001
        asked.extend(items)
        return {
            item: moving._End(item == (1, "density"), False, item[0] == 0, 50.0 + item[0])
            for item in items
        }

    monkeypatch.setattr(moving, "_run", run)
    run_trials(CELL, 1, 0, ["density"], save_dir=tmp_path)
    found = run_trials(CELL, 2, 0, ["density", "passive"], save_dir=tmp_path)
    assert asked == [(0, "density"), (0, "passive"), (1, "density"), (1, "passive")]
    assert found["density"] == moving.Outcomes(2, 1, 1, 0, 50.5)
    assert run_trials(CELL, 2, 0, ["passive", "density"], save_dir=tmp_path) == found
    file = tmp_path / "panda_1_0.5_resting_estimated.jsonl"
    file.write_text(file.read_text(encoding="utf-8") + "{}\n", encoding="utf-8")
    with pytest.raises(DensarmError, match="line 5 is no run"):
        run_trials(CELL, 2, 0, ["density"], save_dir=tmp_path)


def test_arms_without_links_to_aim_at_are_refused() -> None:
    with pytest.raises(DensarmError, match="'two_link': balls are aimed at links from joint 3"):
        Cell("two_link", 1, 0.5)


@pytest.mark.slow
def test_balls_of_unknown_velocity_are_evaded(panda: Arm) -> None:
    trial = draw_trial(panda, 1, 0.5, 1)
    assert run_trial(trial, "density", np.random.default_rng(0)).reached


@pytest.mark.slow
def test_the_arm_does_not_step_aside_to_where_a_wall_keeps_it(panda: Arm) -> None:
    trial = draw_trial(panda, 4, 1.0, 7)
    assert not run_trial(trial, "density").has_contact


@pytest.mark.parametrize("method", ["mink", "cbfpy"])
def test_a_peer_that_is_not_installed_is_asked_for(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(moving, "find_spec", lambda _: None)
    with pytest.raises(DensarmError, match=rf"{method}, not installed: pip install"):
        run_trials(CELL, 1, 0, [method])


@pytest.mark.parametrize("law", [DamperEvasion, CbfpyEvasion, MinkEvasion])
def test_laws_keep_the_rate_of_the_nearest_pair(panda: Arm, law: type[Evasion]) -> None:
    """Towards a ball, slowly enough for accelerations not to count."""
    for name in {CbfpyEvasion: ["cbfpy", "elastiqp"], MinkEvasion: ["mink", "daqp"]}.get(law, []):
        if find_spec(name) is None:
            pytest.skip(f"{name} is not installed: pip install '.[peers]'")
    arm, q = panda, panda.postures["ready"]
    ball = Sphere(name="ball", radius=0.05, position=(1.0, 0.0, 0.5), motion=STILL)
    world = World(arm, Scene([ball]))
    to_ball = np.flatnonzero(["ball" in names for names in world.pairs])
    near = world.distances(q)[to_ball].min() - MARGIN - 0.005
    row = world.query(q)[to_ball[world.distances(q)[to_ball].argmin()]]
    at = np.array(ball.position) - near * row[1:4]
    world = World(arm, Scene([replace(ball, position=tuple(at.tolist()))]))
    evasion = law(world, pairs := ActivePairs(world), 0.0)
    assert evasion.is_needed()
    pairs.update(q)
    sample = world.clearance(q)
    k = int(to_ball[sample.distance[to_ball].argmin()])
    slope = sample.gradient[k]
    nominal = -0.12 * slope / np.linalg.norm(slope)  # in 25 ms from rest
    found, gives_way = evasion.velocity(q, np.zeros(arm.nv), nominal)
    assert gives_way
    assert (np.abs(found) <= 0.9 * arm.limits.acceleration / EVADING_GAIN).all()
    assert slope @ found == pytest.approx(-RATE * (sample.distance[k] - MARGIN), rel=1e-2)
