from dataclasses import replace

import coal
import numpy as np
import pytest

from densarm.errors import InvalidValueError
from densarm.values.arrays import Vector
from densarm.visualization.camera import FIELD_OF_VIEW, Camera
from densarm.visualization.palette import Color
from densarm.visualization.rasterizer import Rasterizer
from densarm.visualization.triangle_mesh import TriangleMesh, mesh_of

WIDTH, HEIGHT = 160, 120
CAMERA = Camera(np.zeros(3), np.array([0.0, -5.0, 0.0]))
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def ball(
    radius: float, color: Color, centre: Vector = (0.0, 0.0, 0.0), lit: bool = False
) -> TriangleMesh:
    mesh = mesh_of(coal.Sphere(radius))
    return replace(
        mesh,
        vertices=mesh.vertices + centre,
        normals=lit * mesh.normals,
        colors=np.tile(color, (len(mesh.vertices), 1)),
    )


@pytest.fixture
def raster() -> Rasterizer:
    return Rasterizer(CAMERA, WIDTH, HEIGHT)


def reds(raster: Rasterizer) -> int:
    return int((raster.pixels() == [255, 0, 0]).all(axis=2).sum())


def test_empty_picture_is_white(raster: Rasterizer) -> None:
    pixels = raster.pixels()
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    assert (pixels == 255).all()


def test_ball_covers_the_disc_that_optics_say(raster: Rasterizer) -> None:
    raster.fill(ball(1.0, RED))
    tangent = 1.0 / np.sqrt(5.0**2 - 1.0)
    radius = HEIGHT / 2.0 * tangent / np.tan(np.radians(FIELD_OF_VIEW) / 2.0)
    assert reds(raster) == pytest.approx(np.pi * radius**2, rel=0.06)


@pytest.mark.parametrize(("x", "z"), [(0.0, 0.0), (-1.0, 0.6), (0.3, -1.0)])
def test_position_is_where_it_is_drawn(raster: Rasterizer, x: float, z: float) -> None:
    raster.fill(ball(0.2, RED, (x, 0.0, z)))
    rows, columns = np.nonzero((raster.pixels() == [255, 0, 0]).all(axis=2))
    column, row = raster.position(np.array([x, 0.0, z]))
    assert columns.mean() + 0.5 == pytest.approx(column, abs=0.7)
    assert rows.mean() + 0.5 == pytest.approx(row, abs=0.7)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_near_hides_far_in_any_order(raster: Rasterizer, order: tuple[int, int]) -> None:
    balls = [ball(0.5, RED, (0.0, -2.0, 0.0)), ball(0.5, BLUE, (0.0, 2.0, 0.0))]
    for k in order:
        raster.fill(balls[k])
    assert raster.pixels()[HEIGHT // 2, WIDTH // 2].tolist() == [255, 0, 0]


def test_translucent_blends_and_hides_nothing(raster: Rasterizer) -> None:
    raster.fill(ball(0.5, RED, (0.0, -2.0, 0.0)), opacity=0.5)
    assert raster.pixels()[HEIGHT // 2, WIDTH // 2] == pytest.approx([255, 128, 128], abs=1)
    raster.fill(ball(0.5, BLUE))
    assert raster.pixels()[HEIGHT // 2, WIDTH // 2].tolist() == [0, 0, 255]


def test_what_is_lifted_back_is_covered_by_the_same(raster: Rasterizer) -> None:
    raster.fill(ball(0.5, RED))
    raster.fill(ball(0.5, BLUE), lift=0.99)
    assert raster.pixels()[HEIGHT // 2, WIDTH // 2].tolist() == [255, 0, 0]


def test_light_falls_from_above(raster: Rasterizer) -> None:
    raster.fill(ball(1.0, (0.5, 0.5, 0.5), lit=True))
    column = raster.pixels()[:, WIDTH // 2, 0].astype(int)
    assert column[HEIGHT // 2 - 20] > column[HEIGHT // 2 + 20] + 30


def test_line_is_as_wide_as_asked(raster: Rasterizer) -> None:
    raster.lines(np.array([[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]]), RED, 4.0, 1.0)
    assert (raster.pixels()[:, WIDTH // 2] == [255, 0, 0]).all(axis=1).sum() == 4
    raster.clear()
    assert reds(raster) == 0


def test_what_is_behind_the_camera_is_left_out(raster: Rasterizer) -> None:
    raster.fill(ball(1.0, RED, (0.0, -7.0, 0.0)))
    raster.lines(np.array([[[0.0, -9.0, 0.0], [0.0, 0.0, 0.0]]]), RED, 4.0, 1.0)
    assert reds(raster) == 0


def test_triangle_without_an_area_draws_nothing(raster: Rasterizer) -> None:
    mesh = ball(1.0, RED)
    raster.fill(replace(mesh, faces=mesh.faces[:, [0, 1, 1]]))
    raster.fill(replace(mesh, vertices=mesh.vertices * [1.0, 1.0, 0.0]))
    assert (raster.pixels() == 255).all()


def test_mesh_without_colours_is_refused(raster: Rasterizer) -> None:
    with pytest.raises(InvalidValueError, match="colors"):
        raster.fill(mesh_of(coal.Sphere(1.0)))
