"""Make the cloud of the scenario panda_shelf_cloud: its shelf as three depth cameras see it.

    python benchmarks/shelf_cloud.py

The shelf is that of panda_shelf, with three objects in it. The cameras stand behind and beside the
arm and look into it; the arm itself is not there. Of each cube of 15 mm one point is kept.
"""

import sys

import numpy as np

from densarm.arms.catalogue import scenario_paths
from densarm.scenarios.scenario import load_scenario
from densarm.scene.depth_camera import seen_points
from densarm.scene.obstacles import Box, Cylinder, Sphere
from densarm.scene.point_cloud import checked_points, voxel_filter

OBJECTS = (
    Cylinder(name="can", radius=0.04, length=0.14, position=(0.72, -0.26, 0.34)),
    Box(name="carton", size=(0.12, 0.16, 0.2), position=(0.78, 0.27, 0.36)),
    Sphere(name="ball", radius=0.06, position=(0.8, -0.25, 0.67)),
)
INTRINSICS = np.array([[520.0, 0.0, 319.5], [0.0, 520.0, 239.5], [0.0, 0.0, 1.0]])  # [pixels]
SHAPE = (480, 640)
CAMERAS = ((-0.35, 0.7, 1.0), (-0.35, -0.7, 1.0), (-0.2, 0.0, 0.35))  # [m]
TARGET = np.array([0.75, 0.0, 0.6])  # [m]
VOXEL = 0.015  # [m]


def main() -> int:
    scene = [*load_scenario("panda_shelf").scene, *OBJECTS]
    seen = [seen_points(scene, INTRINSICS, SHAPE, place, TARGET) for place in CAMERAS]
    points, _ = checked_points("points", np.vstack(seen))
    points = voxel_filter(points, VOXEL).astype(np.float32)
    path = scenario_paths()["panda_shelf"].with_name("panda_shelf_cloud.npy")
    np.save(path, points)
    print(f"{path}: {len(points)} points, {path.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
