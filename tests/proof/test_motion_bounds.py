"""Bounds on motion hold at every corner of every shape along a segment."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.proof.motion_bounds import write_motion_bounds
from densarm.proof.moving_hulls import moving_hulls, place
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Scene
from densarm.shapes import extreme_points

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
ARMS = {
    "two_link": lambda: load_arm("two_link"),
    "panda": lambda: load_arm("panda"),
    "branching": lambda: load_arm(BRANCHING),
}
PARTS = 8
RATES = st.tuples(*[st.floats(-1.5, 1.5)] * 7)


@pytest.fixture(scope="module", params=ARMS)
def clearance(request) -> Clearance:
    return Clearance(ARMS[request.param](), Scene())


def bounds(clearance: Clearance, angles, step) -> tuple[np.ndarray, np.ndarray]:
    """Bounds on the motion from joint positions by a step, of each shape seen from each joint."""
    bodies, _ = moving_hulls(clearance)
    joints, shapes = bodies.joints.copy(), bodies.frame.copy()
    asked = np.ones(len(bodies.joint), dtype=bool)
    place(*bodies[:4], asked, angles, step, 0.5, joints, shapes)
    motion, bend = np.full((2, len(bodies.joint), len(bodies.parent)), np.nan)
    lever = SweptBound(clearance).shape_lever
    chain = bodies.parent, bodies.joints, bodies.joint, bodies.ball, lever, asked
    write_motion_bounds(*chain, step, 1.0, joints, shapes, motion, bend)
    return motion, bend


def corners_seen_from(clearance: Clearance, joint: int, shape, angles, step) -> np.ndarray:
    """Corners of a shape on the way, as the frame of a joint sees them (PARTS + 1, P, 3)."""
    arm, (points, _) = clearance.arm, extreme_points(shape.geometry)
    seen = []
    for share in np.linspace(0.0, 1.0, PARTS + 1):
        pin.forwardKinematics(arm.model, arm.data, arm.configuration(angles + share * step))
        pose = arm.data.oMi[joint].actInv(arm.data.oMi[shape.parentJoint]) * shape.placement
        seen.append(points @ pose.rotation.T + pose.translation)
    return np.array(seen)


@given(angles=RATES, step=RATES)
def test_points_move_and_bend_no_more(clearance, angles, step):
    limits = clearance.arm.limits  # a joint that slides moves no farther than its limits
    angles, step = (np.array(values)[: clearance.arm.nv] for values in (angles, step))
    angles = np.clip(angles, limits.lower, limits.upper)
    step = np.clip(angles + step, limits.lower, limits.upper) - angles
    motion, bend = bounds(clearance, angles, step)
    for index, shape in enumerate(clearance.geometry_model.geometryObjects):
        for joint in np.flatnonzero(np.isfinite(motion[index]))[:3]:
            seen = corners_seen_from(clearance, int(joint), shape, angles, step)
            moved = np.linalg.norm(np.diff(seen, axis=0), axis=2).max()
            bent = np.linalg.norm(np.diff(seen, n=2, axis=0), axis=2).max()
            assert moved <= motion[index, joint] / PARTS + 1e-12
            assert bent <= bend[index, joint] / PARTS**2 + 1e-12


def test_one_joint_that_turns_a_stretched_arm():
    """The tip of two links of one metre moves on a circle of two metres."""
    clearance = Clearance(load_arm("two_link"), Scene())
    motion, bend = bounds(clearance, np.zeros(2), np.array([0.3, 0.0]))
    assert 0.3 * 2.0 <= motion[:, 0].max() <= 0.3 * 2.2
    assert 0.3**2 * 2.0 <= bend[:, 0].max() <= 0.3**2 * 2.2
    assert np.nanmax(motion[:, 1]) == np.nanmax(bend[:, 1]) == 0.0
