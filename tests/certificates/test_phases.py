"""Certificates of phases: what they prove fails as soon as it is not true."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import densarm
from densarm.arms.arm import Arm
from densarm.arms.upright import Upright
from densarm.certificates.certificate import Certificate
from densarm.certificates.phases import LINE, UPRIGHT, WAY_POINTS, Phase, certify_phases
from densarm.errors import FileContentError
from densarm.scene.scene import Scene
from densarm.simulation.run import Run

pytestmark = pytest.mark.slow

LIFT, LAST = 3, 7


@pytest.fixture(scope="module")
def phases(carried_can: Run) -> list[Phase]:
    return [Phase(run.task, run.certificate, run.q, run.v) for run in carried_can.phases]


def failing(phases: list[Phase]) -> list[str]:
    certificate = certify_phases(phases)
    assert not certificate.certified
    return [check.name for check in certificate.checks if check.holds is False]


def holding(phase: Phase, **changes: Any) -> Phase:
    """Return a phase whose held body is held otherwise."""
    arm = phase.task.arm.description
    attachments = [replace(each, **changes) for each in arm.attachments]
    task = replace(phase.task, arm=Arm(replace(arm, attachments=attachments)))
    return phase._replace(task=task)


def moved(phase: Phase, name: str, by: float) -> Phase:
    bodies = [
        replace(x, position=np.add(x.position, (0.0, 0.0, by))) if x.name == name else x
        for x in phase.task.scene
    ]
    return phase._replace(task=replace(phase.task, scene=Scene(bodies)))


def test_as_they_are(phases: list[Phase]) -> None:
    assert certify_phases(phases).certified


def test_a_first_phase_begins_at_rest(phases: list[Phase]) -> None:
    goes_on = next(k for k, phase in enumerate(phases) if phase.task.begins_in_motion)
    certificate = certify_phases(phases[goes_on:])
    told = {check.name: check.detail for check in certificate.checks if check.holds is False}
    assert told["joined"] == "the first phase begins in motion"


def test_a_phase_that_begins_in_motion_is_no_run_by_itself(
    carried_can: Run, tmp_path: Path
) -> None:
    goes_on = next(run for run in carried_can.phases if run.task.begins_in_motion)
    goes_on.save(tmp_path / "phase.npz")
    with pytest.raises(FileContentError, match=r"start_velocity = .* but in a phase of a run"):
        Run.load(tmp_path / "phase.npz")


def test_what_was_put_down_may_not_move(phases: list[Phase]) -> None:
    assert failing([*phases[:LAST], moved(phases[LAST], "can", 1e-6)]) == ["held"]


def test_nor_what_stands(phases: list[Phase]) -> None:
    assert failing([moved(phases[0], "table", -0.01), *phases[1:]]) == ["held"]


def test_nor_what_is_taken(phases: list[Phase]) -> None:
    (held,) = phases[LIFT].task.arm.description.attachments
    body = replace(held.body, position=np.add(held.body.position, (0.0, 1e-6, 0.0)))
    assert "held" in failing(
        [*phases[:LIFT], holding(phases[LIFT], body=body), *phases[LIFT + 1 :]]
    )


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda p: p._replace(q=p.q + 1e-6), "is 1e-06 away from where it was"),
        (lambda p: p._replace(task=replace(p.task, arm=densarm.load_arm("ur5"))), "another robot"),
        (
            lambda p: p._replace(
                task=replace(p.task, simulation=replace(p.task.simulation, dt=0.002))
            ),
            "another time step",
        ),
    ],
)
def test_a_phase_begins_where_the_last_ended(
    phases: list[Phase], change: Callable[[Phase], Phase], told: str
) -> None:
    if "robot" in told:
        ur5 = densarm.load_arm("ur5")
        q = ur5.postures["neutral"]
        task = replace(phases[LAST].task, arm=ur5, start=q, goal=q, start_velocity=None)
        other = phases[LAST]._replace(task=task, q=q[np.newaxis], v=np.zeros((1, ur5.nv)))
    else:
        other = change(phases[LAST])
    certificate = certify_phases([*phases[:LAST], other])
    (joined,) = (check for check in certificate.checks if check.name == "joined")
    assert joined.holds is False
    assert told in joined.detail


def test_what_is_held_or_moves_changes_at_rest_alone(phases: list[Phase]) -> None:
    fast = phases[LIFT - 1]._replace(v=phases[LIFT - 1].v + 0.002)
    assert failing([*phases[: LIFT - 1], fast, *phases[LIFT:]]) == ["joined"]


def test_no_velocity_is_lost_while_the_arm_is_the_same(phases: list[Phase]) -> None:
    assert np.abs(phases[1].v[0]).max() > 0.0
    slower = phases[1]._replace(v=np.vstack([0.0 * phases[1].v[:1], phases[1].v[1:]]))
    assert failing([phases[0], slower, *phases[2:]]) == ["joined"]


def test_a_frame_off_its_line(phases: list[Phase]) -> None:
    line = dict(phases[LIFT].task.settings[LINE])
    line["end"] = [line["end"][0] + 0.003, *line["end"][1:]]
    settings = {**phases[LIFT].task.settings, LINE: line}
    off = phases[LIFT]._replace(task=replace(phases[LIFT].task, settings=settings))
    assert failing([*phases[:LIFT], off, *phases[LIFT + 1 :]]) == ["line"]


def test_way_points_that_are_passed_otherwise(phases: list[Phase]) -> None:
    """The first phase passes where it is after 0.3 and 0.6 s, in this order alone."""

    def told(rows: list[int], off: float) -> list[Phase]:
        positions = phases[0].task.arm.angles(phases[0].q[rows]) + off
        settings = {WAY_POINTS: {"positions": positions.tolist(), "blend": 0.01}}
        task = replace(phases[0].task, settings={**phases[0].task.settings, **settings})
        return [phases[0]._replace(task=task), *phases[1:]]

    assert certify_phases(told([300, 600], 0.005)).certified
    assert failing(told([600, 300], 0.0)) == ["way points"]
    assert failing(told([300], 0.03)) == ["way points"]


def test_a_frame_that_tilts_farther_than_it_may(phases: list[Phase]) -> None:
    arm, q = phases[0].task.arm, phases[0].q
    upright = Upright.from_start(arm, q[0], "panda_hand_tcp", 0.1)
    tilt = float(upright.tilts(arm, q).max())

    def told(within: float) -> list[Phase]:
        said = {UPRIGHT: upright._replace(within=within).to_json()}
        task = replace(phases[0].task, settings={**phases[0].task.settings, **said})
        return [phases[0]._replace(task=task), *phases[1:]]

    assert 0.02 < tilt < 1.5
    assert certify_phases(told(tilt + 0.01)).certified
    assert failing(told(tilt)) == ["upright"]  # which it may exceed between samples
    assert failing(told(0.5 * tilt)) == ["upright"]


@pytest.mark.parametrize(
    "said",
    [
        {LINE: 5},
        {WAY_POINTS: {"positions": [[0.0]], "blend": 0.1}},
        {WAY_POINTS: {"positions": []}},
        {UPRIGHT: {"frame": "panda_hand", "within": 0.1}},
    ],
)
def test_claims_that_are_none_make_no_run(
    said: dict[str, Any], carried_can: Run, tmp_path: Path
) -> None:
    first = carried_can.phases[0]
    task = replace(first.task, settings={**first.task.settings, **said})
    replace(first, task=task).save(tmp_path / "run.npz")
    with pytest.raises(FileContentError, match="not a run"):
        Run.load(tmp_path / "run.npz")


def test_a_body_that_may_touch_does_not_enter(phases: list[Phase]) -> None:
    """The table is 2 mm higher in all phases, so that it stands in the can."""
    assert failing([moved(phase, "table", 0.002) for phase in phases]) == ["support"]


def test_no_pair_is_left_out_off_a_line(phases: list[Phase]) -> None:
    assert phases[LIFT + 1].task.settings.get(LINE) is None
    loose = holding(phases[LIFT + 1], touch_obstacles=("table",))
    assert failing([*phases[: LIFT + 1], loose, *phases[LIFT + 2 :]]) == ["support"]


def test_one_phase_that_is_not_certified(phases: list[Phase]) -> None:
    bad = replace(phases[2].certificate.checks[0], holds=False)
    broken = phases[2]._replace(certificate=Certificate((bad,)))
    certificate = certify_phases([*phases[:2], broken, *phases[3:]])
    assert not certificate.certified
    (swept,) = (check for check in certificate.checks if check.name == "swept")
    assert swept.detail.startswith("phase 3 (grip: panda_finger_joint1 0.0336), t from its start")
