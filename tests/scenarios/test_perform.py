"""Steps one after another: what is carried, what is proved of it, and where it ends."""

import json
from pathlib import Path

import numpy as np
import pytest

import densarm
from densarm.certificates.phases import REST_VELOCITY, body_poses
from densarm.cli import main
from densarm.scenarios.steps import Step
from densarm.simulation.run import Run
from densarm.values.outcome import Outcome
from densarm.world.world import World

pytestmark = pytest.mark.slow

TCP, DOWN = "panda_hand_tcp", (1.0, 0.0, 0.0, 0.0)


def ended(world: World, *steps: Step) -> Run:
    return densarm.run_steps(world, world.arm.postures["ready"], steps)


def test_a_can_is_carried_and_all_of_it_certified(carried_can: Run) -> None:
    run = carried_can
    assert (run.outcome, run.certified) == (Outcome.REACHED, True), run.certificate.checks
    held = [len(phase.task.arm.description.attachments) for phase in run.phases]
    assert held == [0, 0, 0, 1, 1, 1, 0, 0]
    masses = [sum(i.mass for i in phase.task.arm.model.inertias) for phase in run.phases]
    assert masses[3] - masses[1] == pytest.approx(0.3)
    end = body_poses(run.phases[-1].task, run.phases[-1].q[-1])["can"][1].translation
    assert end == pytest.approx([0.5, 0.1, 0.18], abs=5e-4)
    by_name = {check.name: check for check in run.certificate.checks}
    assert all(
        by_name[name].holds for name in ("joined", "held", "line", "upright", "support", "swept")
    )
    assert "can and table (phase 4); can and table (phase 6)" in by_name["support"].detail


def test_its_time_goes_on_and_holds_all_joints(carried_can: Run) -> None:
    run, arm = carried_can, carried_can.task.arm
    assert arm.joint_names[7:] == ("panda_finger_joint1", "panda_finger_joint2")
    assert np.diff(run.time) == pytest.approx(run.task.simulation.dt)
    assert run.time[-1] == pytest.approx(sum(phase.time[-1] for phase in run.phases))
    assert np.abs(np.diff(run.q, axis=0)).max() <= 3.0 * run.task.simulation.dt
    grip = run.phases[2].task.arm
    assert grip.joint_names == ("panda_finger_joint1", "panda_finger_joint2")
    assert run.q[-1, 7:] == pytest.approx([0.038, 0.038], abs=1e-5)  # the second mimics the first
    assert np.abs(run.phases[2].q[:, 0] - run.phases[2].q[:, 1]).max() <= 1e-5
    assert all(np.abs(phase.v[-1]).max() <= REST_VELOCITY for phase in run.phases)
    for row in (0, 500, len(run.time) - 1):
        ((phase, k),) = run.located([row])
        assert run.clearance[row] == phase.clearance[k]


def test_record_is_read_again(carried_can: Run, tmp_path: Path) -> None:
    carried_can.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.certified
    assert again.summary() == carried_can.summary()
    for name in ("time", "q", "v", "tau", "clearance"):
        np.testing.assert_array_equal(getattr(again, name), getattr(carried_can, name))
    assert main(["verify", str(tmp_path / "run.npz"), "--json", str(tmp_path / "v.json")]) == 0
    proved = json.loads((tmp_path / "v.json").read_text())
    assert {"joined", "held", "line", "support"} <= {x["name"] for x in proved["checks"]}


def test_the_payload_changes_in_mujoco(
    can_on_a_table: World, carrying_steps: tuple[Step, ...]
) -> None:
    start = can_on_a_table.arm.postures["ready"]
    run = densarm.run_steps(can_on_a_table, start, carrying_steps, plant="mujoco")
    assert (run.outcome, run.certified) == (Outcome.REACHED, True), run.detail
    assert run.task.plant == "mujoco"


def test_the_next_grasp_is_taken_and_the_others_told(can_on_a_table: World) -> None:
    """The first is nearer, and its approach would lead the hand into the can."""
    beside = densarm.Pose(TCP, [0.5, -0.17, 0.315], DOWN)
    above = densarm.Pose(TCP, [0.5, -0.2, 0.315], DOWN, "z")
    approach = densarm.Line(TCP, along=[0.0, 0.0, 0.1])
    run = ended(can_on_a_table, densarm.MoveTo([beside, above]), approach)
    assert (run.outcome, run.certified) == (Outcome.REACHED, True), run.detail
    where = run.phases[-1].task.arm.pose(run.phases[-1].q[-1], TCP).position
    assert where == pytest.approx([0.5, -0.2, 0.215], abs=1e-3)
    assert "passed over ways to goal 1: the line of 'panda_hand_tcp' along" in run.remark
    assert "and can overlap by" in run.remark


def test_a_move_passes_its_way_points(can_on_a_table: World, tmp_path: Path) -> None:
    arm = can_on_a_table.arm
    aside = densarm.Pose(TCP, [0.45, 0.3, 0.45], DOWN, "z")
    raised = arm.configuration([0.3, -0.4, 0.0, -1.8, 0.0, 1.6, 0.8])
    above = densarm.Pose(TCP, [0.5, -0.2, 0.315], DOWN, "z")
    move = densarm.MoveTo(above, through=[aside, raised], blend=0.03)
    run = ended(can_on_a_table, move, densarm.Line(TCP, along=[0.0, 0.0, 0.1]))
    assert (run.outcome, run.certified) == (Outcome.REACHED, True), run.detail
    run.save(tmp_path / "run.npz")
    by_name = {check.name: check for check in Run.load(tmp_path / "run.npz").certificate.checks}
    assert by_name["way points"].detail.startswith("2 passed in their order, each joint within 0.0")
    q, v = run.phases[0].q, run.phases[0].v
    nearest = np.abs(arm.difference(raised, q)).max(axis=1).argmin()
    assert np.abs(v[nearest]).max() > 0.2


def test_no_grasp_leads_on(can_on_a_table: World) -> None:
    beside = densarm.Pose(TCP, [0.5, -0.17, 0.315], DOWN)
    run = ended(can_on_a_table, densarm.MoveTo(beside), densarm.Line(TCP, along=[0.0, 0.0, 0.1]))
    assert (run.outcome, run.certified) == (Outcome.NO_PATH, False)
    assert run.detail.startswith(
        "step 1 of 2, move 'panda_hand_tcp' to (0.5, -0.17, 0.315) m: none"
    )
    assert "goal 1: the line of" in run.detail


def test_what_is_out_of_hand_is_not_taken(can_on_a_table: World) -> None:
    rest = densarm.Wait(0.1)
    run = ended(can_on_a_table, rest, densarm.Attach("can", "panda_hand"), rest)
    assert (run.outcome, run.certified) == (Outcome.INFEASIBLE, False)
    assert "step 2 of 3, attach 'can' to 'panda_hand': 'can' is" in run.detail
    assert "mm away from what moves with 'panda_hand', and may be 10 mm at most" in run.detail


def test_what_is_put_down_in_the_air_is_told(
    can_on_a_table: World, carrying_steps: tuple[Step, ...]
) -> None:
    put = densarm.Detach("can", "table"), densarm.Wait(0.1)
    run = ended(can_on_a_table, *carrying_steps[:5], *put)
    assert (run.outcome, run.certified) == (Outcome.INFEASIBLE, False)
    assert "'table' is 100 mm away from 'can', and may be 1 mm at most" in run.detail


def test_a_gripper_that_would_squeeze_is_told(
    can_on_a_table: World, carrying_steps: tuple[Step, ...]
) -> None:
    grip = densarm.Grip({"panda_finger_joint1": 0.03})
    run = ended(can_on_a_table, *carrying_steps[:2], grip)
    assert run.outcome == Outcome.INFEASIBLE
    assert "goal: panda_" in run.detail
    assert "and can overlap by" in run.detail
