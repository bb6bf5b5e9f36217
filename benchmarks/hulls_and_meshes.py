"""Compare the shapes that an arm measures distances of with its meshes, in random configurations.

    python benchmarks/hulls_and_meshes.py [ROBOT ...] [--shapes hull] [--configurations 1000]

ROBOT is a known name or the path of a URDF. The table has the pairs of links whose hulls overlap
where the meshes are 5 mm apart, by coal's distance of mesh and mesh: in how many configurations,
and in how many of them the arm's own shapes overlap too. The exit status is 1 if those do in any,
or are apart where meshes touch.
"""

import argparse
import sys

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm import load_arm
from densarm.arms.arm import Arm
from densarm.arms.catalogue import robot_names
from densarm.arms.link_pieces import one_inside_the_other
from densarm.arms.models import build_collision_meshes
from densarm.scene.mesh import indexed_triangles
from densarm.scene.scene import Scene
from densarm.scene.shapes import convex_hull
from densarm.values.arrays import Array
from densarm.world.world import DISTANCE_TOLERANCE, World

APART = 0.005  # [m]
SEED = 1  # others than the configurations by which links are cut
COLUMNS = ("hulls overlap", "meshes 5 mm apart", "shapes overlap then", "missed contacts")

Counts = dict[tuple[str, str], NDArray[np.int64]]


def compared(arm: Arm, configurations: int) -> Counts:
    """Return for each pair of links, as meshes, in how many configurations each column holds."""
    drawn = {item.name: item for item in build_collision_meshes(arm.description).geometryObjects}
    world = World(arm, Scene([]))
    own: dict[tuple[str, str], list[int]] = {}
    for k, shapes in enumerate(world.pairs):
        first, second = sorted(x if x in drawn else x.rpartition(".")[0] for x in shapes)
        own.setdefault((first, second), []).append(k)
    models = [geometry([change(x) for x in drawn.values()], list(own)) for change in (hull, mesh)]
    hulls, meshes = ((model, model.createData()) for model in models)
    counts = {pair: np.zeros(len(COLUMNS), dtype=np.int64) for pair in own}
    random, surfaces = np.random.default_rng(SEED), dict[int, Array]()
    low, high = np.clip([arm.limits.lower, arm.limits.upper], -np.pi * 2.0, np.pi * 2.0)
    for _ in range(configurations):
        q = arm.configuration(random.uniform(low, high))
        distances = world.distances(q)
        for shapes in (hulls, meshes):
            pin.updateGeometryPlacements(arm.model, arm.data, *shapes, q)
        for k, (pair, indices) in enumerate(own.items()):
            if pin.computeDistance(*hulls, k).min_distance <= 0.0:
                gap = pin.computeDistance(*meshes, k).min_distance
                if gap > 0.0 and one_inside_the_other(*meshes, k, surfaces):
                    gap = 0.0  # by their surfaces they are apart
                overlap = distances[indices].min() <= DISTANCE_TOLERANCE
                apart = gap >= APART
                counts[pair] += [1, apart, apart and overlap, gap <= 0.0 and not overlap]
    return counts


def geometry(items: list[pin.GeometryObject], pairs: list[tuple[str, str]]) -> pin.GeometryModel:
    model = pin.GeometryModel()
    for item in items:
        model.addGeometryObject(item)
    for pair in pairs:
        model.addCollisionPair(pin.CollisionPair(*map(model.getGeometryId, pair)))
    return model


def hull(item: pin.GeometryObject) -> pin.GeometryObject:
    item = item.copy()
    if isinstance(item.geometry, coal.BVHModelBase):
        item.geometry, item.meshScale = convex_hull(item.geometry.vertices()), np.ones(3)
    return item


def mesh(item: pin.GeometryObject) -> pin.GeometryObject:
    """Return it with the one tree of boxes by which coal measures distances between meshes."""
    item = item.copy()
    if isinstance(item.geometry, coal.BVHModelBase):
        vertices, triangles = indexed_triangles(item.geometry)
        item.geometry, item.meshScale = coal.BVHModelOBBRSS(), np.ones(3)
        item.geometry.beginModel(len(triangles), len(vertices))
        item.geometry.addVertices(vertices)
        item.geometry.addTriangles(triangles)
        item.geometry.endModel()
    return item


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("robots", nargs="*", default=robot_names())
    parser.add_argument("--shapes", default="hull")
    parser.add_argument("--configurations", type=int, default=1000)
    options = parser.parse_args()
    total = np.zeros(len(COLUMNS), dtype=np.int64)
    print(f"{'robot':<14}{'links':<56}" + "".join(f"{name:>21}" for name in COLUMNS))
    for robot in options.robots:
        arm = load_arm(robot, shapes=options.shapes)
        counts = compared(arm, options.configurations)
        rows = {f"{a} {b}": row for (a, b), row in counts.items() if row[1:].any()}
        rows["all"] = np.sum(list(counts.values()), axis=0)
        for links, row in rows.items():
            print(f"{arm.name:<14}{links:<56}" + "".join(f"{n:>21}" for n in row), flush=True)
        total += rows["all"]
    return 1 if total[2:].any() else 0


if __name__ == "__main__":
    sys.exit(main())
