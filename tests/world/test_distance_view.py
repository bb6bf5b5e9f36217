"""The view of coal's results agrees with their documented getters, or is not used."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm
from densarm.values.arrays import Array
from densarm.world.distance_view import DistanceView


@pytest.fixture(scope="module")
def arm(arm_named: Callable[[str], Arm]) -> Arm:
    return arm_named("panda")


def computed(
    arm: Arm, q: Array, pairs: int | None = None
) -> tuple[pin.GeometryData, Callable[[Array], None]]:
    """Geometry data with distances at q, and a function that computes them elsewhere."""
    geometry = arm.collision_model.copy()
    for pair in list(geometry.collisionPairs)[pairs or geometry.ngeoms**2 :]:
        geometry.removeCollisionPair(pair)
    data, geometry_data = arm.model.createData(), geometry.createData()

    def compute(q: Array) -> None:
        pin.computeDistances(arm.model, data, geometry, geometry_data, q)

    compute(q)
    return geometry_data, compute


def by_getters(geometry_data: pin.GeometryData) -> list[list[float]]:
    return [
        [r.min_distance, *r.normal, *r.getNearestPoint1(), *r.getNearestPoint2()]
        for r in geometry_data.distanceResults
    ]


@pytest.mark.parametrize("pairs", [1, 2, None])
def test_view_follows_the_results(arm: Arm, pairs: int | None) -> None:
    geometry_data, compute = computed(arm, arm.postures["ready"], pairs)
    view = DistanceView(geometry_data)
    assert view.is_direct
    for q in (arm.postures["ready"], arm.postures["stretched"]):
        compute(q)
        np.testing.assert_array_equal(view.read(), by_getters(geometry_data))
    assert not view.read().flags.writeable


def test_another_layout_falls_back_to_the_getters(
    arm: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    geometry_data, compute = computed(arm, arm.postures["ready"])
    stride = np.lib.stride_tricks.as_strided

    def another_order(*args: Any, **options: Any) -> Array:
        return stride(*args, **options)[:, ::-1]

    monkeypatch.setattr(np.lib.stride_tricks, "as_strided", another_order)
    view = DistanceView(geometry_data)
    assert not view.is_direct
    for q in (arm.postures["ready"], arm.postures["stretched"]):
        compute(q)
        np.testing.assert_array_equal(view.read(), by_getters(geometry_data))


def test_no_pairs() -> None:
    geometry_data = pin.GeometryModel().createData()
    view = DistanceView(geometry_data)
    assert not view.is_direct
    assert view.read().shape == (0, 10)
