"""What three depth cameras see of a shelf, as an obstacle: plan, move and prove.

    python examples/point_cloud.py

There are no cameras: `seen_points` makes what they would see. Expected output:

    13609 points, 60 pairs of bodies
    reached, certified: True, smallest distance 16 mm
"""

import numpy as np

import densarm
from densarm.scene.depth_camera import seen_points
from densarm.scene.point_cloud import voxel_filter
from densarm.world.cloud_filter import CloudFilter

INTRINSICS = np.array([[260.0, 0.0, 159.5], [0.0, 260.0, 119.5], [0.0, 0.0, 1.0]])  # pixels
CAMERAS = [(-0.35, 0.7, 1.0), (-0.35, -0.7, 1.0), (-0.2, 0.0, 0.35)]  # m
TARGET = np.array([0.75, 0.0, 0.6])  # m


def main() -> None:
    scenario = densarm.load_scenario("panda_shelf")
    arm, start = scenario.arm, scenario.start
    seen = [seen_points(scenario.scene, INTRINSICS, (240, 320), x, TARGET) for x in CAMERAS]
    points = CloudFilter(arm).kept(start, np.vstack(seen))
    points = voxel_filter(points, 0.015)
    cloud = densarm.PointCloud(name="shelf", points=points, radius=0.015)
    world = densarm.World(arm, densarm.Scene([cloud]))
    print(f"{len(points)} points, {world.n_pairs} pairs of bodies")
    motion = densarm.plan_motion(world, start, scenario.goal)
    run = densarm.simulate(world, densarm.DensityTracking(world, motion), start)
    distance = 1e3 * run.clearance.min()
    print(f"{run.outcome}, certified: {run.certified}, smallest distance {distance:.0f} mm")


if __name__ == "__main__":
    main()
