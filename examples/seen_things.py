"""A chair, a mug on it and somebody's hand, as eight depth cameras see them: reach under the seat.

python examples/seen_things.py --out .
"""

import argparse
from pathlib import Path

import numpy as np
import pinocchio as pin

import densarm
from densarm.scene.depth_camera import seen_points
from densarm.scene.point_cloud import voxel_filter

INTRINSICS = [[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]]  # pixels
CAMERAS = [(x, y, z) for x in (-0.4, 1.6) for y in (-0.9, 1.1) for z in (0.1, 1.3)]  # m
TARGET = (0.6, 0.1, 0.5)  # m
RING = 0.04 * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 25))  # m


def bar(width: float, begin: tuple[float, ...], end: tuple[float, ...]) -> densarm.Box:
    along, middle = np.subtract(end, begin), 0.5 * np.add(begin, end)
    turn = pin.Quaternion.FromTwoVectors(pin.ZAxis, along).coeffs()
    size = (width, width, float(np.linalg.norm(along)) + 0.8 * width)
    return densarm.Box(name="bar", size=size, position=middle, orientation_xyzw=turn)


CHAIR = [bar(0.035, (x, y, 0.02), (x, y, 0.44)) for x in (0.44, 0.8) for y in (-0.18, 0.18)]
CHAIR += [bar(0.04, (x, -0.2, 0.45), (x, 0.2, 0.45)) for x in np.linspace(0.43, 0.81, 10)]
CHAIR += [bar(0.03, (0.82, y, 0.45), (0.82, y, 0.9)) for y in (-0.18, 0.18)]
CHAIR += [bar(0.03, (0.82, -0.18, z), (0.82, 0.18, z)) for z in (0.7, 0.8, 0.9)]
MUG = [bar(0.01, (0.55 + z.real, z.imag, 0.48), (0.55 + z.real, z.imag, 0.57)) for z in RING]
MUG += [bar(0.01, (0.55, 0.04, z), (0.55, 0.08, 0.53)) for z in (0.55, 0.5)]
WRIST, KNUCKLES = (0.5, 0.3, 0.64), np.arange(0.48, 0.57, 0.023)  # m, and x of them
HAND = [bar(0.06, (0.4, 0.6, 0.8), WRIST), bar(0.022, WRIST, (0.45, 0.2, 0.62))]
for x in KNUCKLES:
    HAND += [bar(0.022, WRIST, (x, 0.2, 0.64)), bar(0.018, (x, 0.2, 0.64), (x, 0.13, 0.6))]


def main(out: Path) -> None:
    clouds = []
    for name, parts in {"chair": CHAIR, "mug": MUG, "hand": HAND}.items():
        seen = [seen_points(parts, INTRINSICS, (240, 320), x, TARGET) for x in CAMERAS]
        points = voxel_filter(np.vstack(seen), 0.008)
        clouds.append(densarm.PointCloud(name=name, points=points, radius=0.008))
    world = densarm.World(densarm.load_arm("panda"), densarm.Scene(clouds))
    ready, under = world.arm.postures["ready"], densarm.Pose("panda_hand_tcp", [0.62, 0.0, 0.25])
    motion = densarm.plan_motion(world, ready, under, margin=0.005)
    run = densarm.simulate(world, densarm.DensityTracking(world, motion), ready, title="A chair")
    least = 1e3 * run.clearance.min()
    print(f"{run.outcome}, certified: {run.certified}, clearance {least:.0f} mm")
    densarm.save_picture(run, out / "seen_things.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the picture")
    main(parser.parse_args().out)
