"""What is told of the times of control steps, and the arm among spheres that they are of."""

from contextlib import nullcontext
from itertools import count

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.control.tracking import DensityTracking
from densarm.density.unsafe_sets import SensingParameters
from densarm.errors import InvalidValueError
from densarm.study import step
from densarm.study.step import (
    full_sensing_controller,
    swing,
    time_first_calls,
    world_among_spheres,
)


def test_a_single_step_follows_none() -> None:
    timing = step.time_step("two_link", pairs=2, steps=1)
    assert timing.steady_percentiles_us is None
    assert timing.resumed_us == timing.step_percentiles_us[0]


def test_steps_after_other_work_do_not_count_as_steady(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = count()
    monkeypatch.setattr(step, "_switches", lambda: next(taken))
    timing = step.time_step("two_link", pairs=2, steps=40)
    assert timing.switches == 40
    assert timing.steady_percentiles_us is None


def test_without_a_switch_all_but_the_first_of_a_turn_are_steady(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(step, "_switches", lambda: 0)
    ticks = count()
    monkeypatch.setattr("time.thread_time", lambda: next(ticks) ** 2)
    timing = step.time_step("two_link", pairs=2, steps=10)
    assert timing.switches == 0
    assert timing.steady_percentiles_us is not None
    assert timing.steady_percentiles_us[0] > timing.resumed_us


def test_steps_among_spheres_that_move_are_timed_beside_the_others() -> None:
    timing = step.time_step("two_link", pairs=4, steps=40, moving=1)
    assert timing.evading_us is not None
    assert timing.evading_us > 0.0
    assert timing.evading_ratio == pytest.approx(timing.evading_us / timing.step_us)
    assert step.time_step("two_link", pairs=2, steps=1).evading_us is None
    with pytest.raises(InvalidValueError, match="moving = 9"):
        step.time_step("two_link", pairs=4, steps=1, moving=9)


@pytest.mark.slow
@pytest.mark.parametrize("shapes", ["hull", "capsule"])
@pytest.mark.parametrize("pairs", [5, 64, 70])
def test_arm_among_spheres_has_the_pairs_asked_for(shapes: str, pairs: int) -> None:
    arm = load_arm("panda", shapes=shapes)
    motion = swing(arm)
    world = world_among_spheres(arm, motion, pairs)
    assert world.n_pairs == pairs
    q = arm.configurations(motion.position[::100])
    assert min(world.distances(row).min() for row in q) > 0.0


def test_some_spheres_are_sensed() -> None:
    arm = load_arm("panda")
    motion = swing(arm)
    world = world_among_spheres(arm, motion, 64)
    q = arm.configurations(motion.position[::20])
    assert min(world.distances(row).min() for row in q) < SensingParameters().distance


def test_number_of_pairs_that_an_arm_cannot_have() -> None:
    arm = load_arm("two_link")
    with pytest.raises(InvalidValueError, match="pairs = 3"):
        world_among_spheres(arm, swing(arm), 3)


def test_full_sensing_leaves_the_spheres_and_feels_them_near_the_motion() -> None:
    """A controller that knew the spheres would sense none of them so near to it."""
    arm = load_arm("panda", torque_rate=np.inf)
    motion = swing(arm)
    world = world_among_spheres(arm, motion, 64)
    scene, knowing = world.scene, DensityTracking(world, motion)
    controller = full_sensing_controller(world, motion)
    assert world.scene == scene
    differs = []
    for k in range(0, len(motion.position), 20):
        q = arm.configuration(motion.position[k] + 1e-3)
        t, v, taus = k * motion.period, motion.velocity[k], []
        for law in (controller, knowing):
            law.torque(t + 1.0, q, v)  # time runs back then: each state is the first that is known
            taus.append(law.torque(t, q, v))
        differs.append(np.abs(taus[0] - taus[1]).max())
    assert min(differs) < 0.1 * max(differs)


@pytest.mark.slow
def test_making_the_controller_is_apart_from_its_first_call(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # With the compiled code that is on disk already: compiling anew takes too long for a test.
    monkeypatch.setattr(step, "TemporaryDirectory", lambda: nullcontext(""))
    for call in time_first_calls("two_link", "hull", 4):
        assert 0.0 < call.torque_us < 1e6 * call.preparation_s
