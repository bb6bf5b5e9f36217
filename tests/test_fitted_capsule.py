"""Fitted capsules enclose what they stand for, and little more."""

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arm import load_arm
from densarm.arrays import Array
from densarm.clearance import DISTANCE_TOLERANCE, Clearance
from densarm.fitted_capsule import FittedCapsule, fitted_capsule
from densarm.scene import Scene, Sphere

BRANCHING = Path(__file__).parent / "data" / "branching.urdf"
ARMS = {"panda": "panda", "branching": BRANCHING}


def outside(points: Array, capsule: FittedCapsule) -> float:
    """How far the farthest point is outside the capsule [m]."""
    axis = capsule.end - capsule.start
    fraction = np.clip((points - capsule.start) @ axis / max(axis @ axis, 1e-300), 0, 1)
    nearest = capsule.start + np.outer(fraction, axis)
    return float(np.linalg.norm(points - nearest, axis=1).max()) - capsule.radius


def corners(shape: coal.ConvexBase, placement: pin.SE3) -> Array:
    return np.array([placement.act(point) for point in shape.points()])


clouds = arrays(np.float64, st.tuples(st.integers(4, 40), st.just(3)), elements=st.floats(-1, 1))


@settings(max_examples=25)
@given(cloud=clouds, size=st.sampled_from([1e-3, 1.0, 1e3]), away=st.floats(-10, 10))
def test_points_are_enclosed(cloud, size, away):
    points = size * (cloud + away)
    assume(np.ptp(points, axis=0).max() > 1e-3 * size)
    assert outside(points, fitted_capsule(points)) <= 0.0


@settings(max_examples=10)
@given(
    radius=st.floats(0.02, 0.3),
    length=st.floats(0.01, 1.0),
    turn=arrays(float, 3, elements=st.floats(-3, 3)),
)
def test_capsules_are_found_again(radius, length, turn):
    random = np.random.default_rng(0)
    ball = random.normal(size=(200, 3))
    ball *= radius / np.linalg.norm(ball, axis=1)[:, np.newaxis]
    ball[:, 2] += np.where(ball[:, 2] > 0, 0.5, -0.5) * length
    capsule = fitted_capsule(ball @ pin.exp3(turn))
    true = FittedCapsule(np.array([0, 0, -length / 2]), np.array([0, 0, length / 2]), radius)
    assert capsule.volume < (1 + 1e-4) * true.volume


@pytest.mark.parametrize("name", ARMS)
def test_bodies_lie_in_their_capsules(name):
    hulls, capsules = (load_arm(ARMS[name], shapes=shapes) for shapes in ("hull", "capsule"))
    assert capsules.joint_names == hulls.joint_names
    pairs = zip(
        hulls.collision_model.geometryObjects, capsules.collision_model.geometryObjects, strict=True
    )
    fitted = 0
    for hull, capsule in pairs:
        assert hull.name == capsule.name
        assert isinstance(capsule.geometry, coal.Capsule | coal.Sphere)
        if isinstance(hull.geometry, coal.ConvexBase):
            half = np.array([0, 0, capsule.geometry.halfLength])
            ends = capsule.placement.act(-half), capsule.placement.act(half)
            again = FittedCapsule(*ends, capsule.geometry.radius)
            assert outside(corners(hull.geometry, hull.placement), again) <= 0.0
            fitted += 1
    assert fitted > 2


@pytest.mark.parametrize("name", ARMS)
def test_capsules_are_never_farther_than_hulls(name):
    scene = Scene([Sphere(name="ball", radius=0.1, position=(0.4, 0.1, 0.5))])
    arms = [load_arm(ARMS[name], shapes=shapes) for shapes in ("hull", "capsule")]
    hulls, capsules = (Clearance(arm, scene) for arm in arms)
    common = [pair for pair in hulls.pairs if pair in capsules.pairs]
    assert len(common) > 0.8 * hulls.n_pairs
    index = [[c.pairs.index(pair) for pair in common] for c in (hulls, capsules)]
    random = np.random.default_rng(0)
    limits = np.clip([arms[0].limits.lower, arms[0].limits.upper], -np.pi, np.pi)
    for _ in range(30):
        q = arms[0].configuration(random.uniform(*limits))
        true, smaller = (c.distances(q)[i] for c, i in zip((hulls, capsules), index, strict=True))
        # Where bodies overlap, depths follow other directions out.
        apart = smaller > 0.0
        assert (smaller[apart] <= true[apart] + DISTANCE_TOLERANCE).all()
        assert (smaller[true < 0.0] <= DISTANCE_TOLERANCE).all()


def test_the_same_body_gives_the_same_capsule():
    points = np.random.default_rng(0).normal(size=(200, 3))
    first, second = fitted_capsule(points), fitted_capsule(points)
    np.testing.assert_array_equal(np.hstack(first), np.hstack(second))
