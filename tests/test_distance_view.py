"""The view of coal's results agrees with their documented getters, or is not used."""

import numpy as np
import pinocchio as pin
import pytest

from densarm.arm import load_arm
from densarm.distance_view import DistanceView


@pytest.fixture
def arm():
    return load_arm("panda")


def computed(arm, q, pairs=None):
    """Geometry data with distances at q, and a function that computes them elsewhere."""
    geometry = arm.collision_model.copy()
    for pair in list(geometry.collisionPairs)[pairs or geometry.ngeoms**2 :]:
        geometry.removeCollisionPair(pair)
    data, geometry_data = arm.model.createData(), geometry.createData()

    def compute(q):
        pin.computeDistances(arm.model, data, geometry, geometry_data, q)

    compute(q)
    return geometry_data, compute


def by_getters(geometry_data):
    return [
        [r.min_distance, *r.normal, *r.getNearestPoint1(), *r.getNearestPoint2()]
        for r in geometry_data.distanceResults
    ]


@pytest.mark.parametrize("pairs", [1, 2, None])
def test_view_follows_the_results(arm, pairs):
    geometry_data, compute = computed(arm, arm.postures["ready"], pairs)
    view = DistanceView(geometry_data)
    assert view.is_direct
    for q in (arm.postures["ready"], arm.postures["stretched"]):
        compute(q)
        np.testing.assert_array_equal(view.read(), by_getters(geometry_data))
    assert not view.read().flags.writeable


def test_another_layout_falls_back_to_the_getters(arm, monkeypatch):
    geometry_data, compute = computed(arm, arm.postures["ready"])
    stride = np.lib.stride_tricks.as_strided

    def another_order(*args, **options):
        return stride(*args, **options)[:, ::-1]

    monkeypatch.setattr(np.lib.stride_tricks, "as_strided", another_order)
    view = DistanceView(geometry_data)
    assert not view.is_direct
    for q in (arm.postures["ready"], arm.postures["stretched"]):
        compute(q)
        np.testing.assert_array_equal(view.read(), by_getters(geometry_data))


def test_no_pairs():
    geometry_data = pin.GeometryModel().createData()
    view = DistanceView(geometry_data)
    assert not view.is_direct
    assert view.read().shape == (0, 10)
