from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.errors import InvalidValueError
from densarm.euclidean.implicit import ImplicitFunction
from densarm.euclidean.shapes import (
    Ball,
    Bowtie,
    CShape,
    Cylinder,
    Egg,
    Ellipsoid,
    Oval,
    PNormBall,
    Torus,
)
from densarm.values.arrays import Array

PLANE: list[ImplicitFunction] = [
    Ball(1.3),
    Ellipsoid((0.5, 2.0), 1.0),
    PNormBall(1.2, 4.0),
    PNormBall(1.2, 2.0),
    Oval(1.0, 1.2),
    Bowtie(2.0, 0.3),
    Egg(0.9, 1.1, 1.3, 2.0),
    CShape(2.0, 0.4, 0.3),
]
SPACE: list[ImplicitFunction] = [
    Ball(0.7),
    Ellipsoid((0.5, 2.0, 1.0), 1.0),
    PNormBall(1.0),
    Torus(2.0, 0.5),
    Cylinder(0.8),
]
# A point inside and a point outside of each shape.
SIDES = [
    (Ball(1.0), (0.9, 0.0), (0.9, 0.5)),
    (Ellipsoid((0.5, 1.0), 1.0), (1.9, 0.0), (0.0, 1.1)),
    (PNormBall(1.0, 20.0), (0.95, 0.95), (1.0, 1.0)),
    (Oval(1.0, 1.2), (1.4, 0.0), (0.0, 0.8)),
    (Bowtie(2.0, 0.3), (1.5, 0.5), (0.0, 0.4)),
    (Egg(1.0, 1.0, 2.0, 1.0), (-0.5, 0.95), (0.5, 0.8)),
    (CShape(2.0, 0.3, 0.0), (-2.0, 0.0), (2.0, 0.0)),
    (CShape(2.0, 0.3, 0.0), (-0.5, 1.9), (0.0, 0.0)),
    (Torus(2.0, 0.5), (0.0, 2.0, 0.4), (0.0, 0.0, 0.0)),
    (Cylinder(0.5), (0.3, 0.3, 1e3), (0.4, 0.4, 0.0)),
]


def points(n: int) -> st.SearchStrategy[Array]:
    return arrays(np.float64, (3, n), elements=st.floats(-3.0, 3.0))


def assert_gradient_is_the_derivative(shape: ImplicitFunction, x: Array) -> None:
    step = 1e-6
    numerical = np.stack(
        [(shape(x + axis) - shape(x - axis)) / (2.0 * step) for axis in step * np.eye(x.shape[-1])],
        axis=-1,
    )
    scale = 1.0 + np.abs(shape(x)).max() + np.abs(numerical).max()
    np.testing.assert_allclose(shape.gradient(x), numerical, atol=1e-7 * scale)


@pytest.mark.slow
@pytest.mark.parametrize("shape", PLANE, ids=repr)
@given(x=points(2))
def test_gradient_is_the_derivative_in_the_plane(shape: ImplicitFunction, x: Array) -> None:
    assert_gradient_is_the_derivative(shape, x)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SPACE, ids=repr)
@given(x=points(3))
def test_gradient_is_the_derivative_in_space(shape: ImplicitFunction, x: Array) -> None:
    assert_gradient_is_the_derivative(shape, x)


@pytest.mark.parametrize("shape", PLANE + SPACE, ids=repr)
def test_batches_of_any_shape_agree_with_single_points(shape: ImplicitFunction) -> None:
    n = 2 if shape in PLANE else 3
    x = np.random.default_rng(0).uniform(-2.0, 2.0, (4, 5, n))
    assert shape(x).shape == (4, 5)
    assert shape.gradient(x).shape == (4, 5, n)
    np.testing.assert_allclose(shape(x[1, 2]), shape(x)[1, 2], rtol=1e-14)
    np.testing.assert_allclose(shape.gradient(x[1, 2]), shape.gradient(x)[1, 2], rtol=1e-14)


@pytest.mark.parametrize(("shape", "inside", "outside"), SIDES, ids=repr)
def test_the_sign_tells_inside_from_outside(
    shape: ImplicitFunction, inside: tuple[float, ...], outside: tuple[float, ...]
) -> None:
    assert shape(np.array(inside)) < 0.0 < shape(np.array(outside))


def test_the_c_is_smooth_at_its_centre_and_does_not_overflow_far_away() -> None:
    shape = CShape(2.0, 0.3, 0.0)
    np.testing.assert_allclose(shape.gradient(np.zeros(2))[1], 0.0, atol=1e-12)
    far = np.array([1e3, -1e3])
    assert np.isfinite(shape(far))
    assert np.isfinite(shape.gradient(far)).all()


@pytest.mark.parametrize(
    "make",
    [
        lambda: Ball(0.0),
        lambda: Ellipsoid((1.0, -1.0), 1.0),
        lambda: PNormBall(1.0, 1.0),
        lambda: Oval(1.0, 0.9),
        lambda: Bowtie(1.0, 0.0),
        lambda: Egg(1.0, 1.0, -1.0, 1.0),
        lambda: CShape(1.0, 0.1, 2.0),
        lambda: Torus(1.0, 1.0),
        lambda: Cylinder(-1.0),
    ],
)
def test_impossible_shapes_are_refused(make: Callable[[], ImplicitFunction]) -> None:
    with pytest.raises(InvalidValueError):
        make()
