"""Plan motions of two arms at once: twelve joints, and every link of one against the other's.

    python benchmarks/two_arms.py --problems 50 --json two_arms.json

The robot is made of two UR10 on one stand, side by side. Starts and goals are drawn evenly within
the position limits and keep 10 mm from contact, first without obstacles, then with a table before
both arms and a pillar between them. A problem may have no solution; that takes longest to tell.
Times are of `plan_motion`, from the world to the timed and proved motion, by the clock and by the
processor.
"""

import argparse
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
from timing.surroundings import print_surroundings, surroundings

import densarm
from densarm.arms.catalogue import robot_description
from densarm.arms.description import RobotDescription
from densarm.cli.output import write_json
from densarm.world.configurations import clear_configurations

MARGIN = 0.01  # [m] that ends keep
SCENES = {
    "free": densarm.Scene(),
    "table": densarm.Scene(
        [
            densarm.Box(name="table", size=(0.8, 2.0, 0.05), position=(0.8, 0.0, 0.1)),
            densarm.Box(name="pillar", size=(0.15, 0.15, 1.2), position=(0.4, 0.0, 0.7)),
        ]
    ),
}


def two_arms(apart: float = 1.0) -> densarm.Arm:
    """Return two UR10 whose bases are so far apart [m]."""
    one = robot_description("ur10")
    robot = ElementTree.Element("robot", name="two_ur10")
    ElementTree.SubElement(robot, "link", name="stand")
    for side, y in (("left", 0.5 * apart), ("right", -0.5 * apart)):
        copy = ElementTree.fromstring(one.urdf)
        links, joints = copy.findall("link"), copy.findall("joint")
        ends = [end for joint in joints for end in (*joint.iter("parent"), *joint.iter("child"))]
        carried = {end.get("link") for end in ends if end.tag == "child"}
        (base,) = {link.get("name") for link in links} - carried
        for part, key in [
            *((part, "name") for part in links + joints),
            *((e, "link") for e in ends),
        ]:
            part.set(key, f"{side}_{part.get(key)}")
        mount = ElementTree.SubElement(robot, "joint", name=f"{side}_mount", type="fixed")
        ElementTree.SubElement(mount, "parent", link="stand")
        ElementTree.SubElement(mount, "child", link=f"{side}_{base}")
        ElementTree.SubElement(mount, "origin", xyz=f"0 {y} 0")
        robot.extend(links + joints)
    text = ElementTree.tostring(robot, encoding="unicode")
    return densarm.Arm(RobotDescription("two_ur10", text, package_dirs=one.package_dirs))


def solved(world: densarm.World, start: np.ndarray, goal: np.ndarray) -> dict[str, Any]:
    wall, processor = time.perf_counter(), time.process_time()
    try:
        motion, outcome = densarm.plan_motion(world, start, goal), "planned"
        duration: float | None = motion.duration
    except densarm.PlanningError as error:
        duration, outcome = None, str(error.outcome)
    return {
        "outcome": outcome,
        "motion_s": duration,
        "wall_s": time.perf_counter() - wall,
        "processor_s": time.process_time() - processor,
    }


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--problems", type=int, default=50)
    parser.add_argument("--apart", type=float, default=1.0, help="distance of the bases [m]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    around = surroundings(("pin", "coal", "ompl", "toppra"))
    print_surroundings(around)
    arm, found = two_arms(options.apart), {}
    for name in options.scenes:
        world = densarm.World(arm, SCENES[name])
        ends = clear_configurations(world, 2 * options.problems, options.seed, MARGIN)
        solved(world, ends[0], ends[1])  # unrecorded: it imports and compiles
        rows = [solved(world, *pair) for pair in zip(ends[::2], ends[1::2], strict=True)]
        found[name] = rows
        planned = sum(row["outcome"] == "planned" for row in rows)
        print(f"{name}: {world.n_pairs} pairs, {planned} of {len(rows)} planned")
        for key in ("wall_s", "processor_s"):
            low, high, most = np.percentile([row[key] for row in rows], [50, 95, 100])
            print(f"  {key:12} median {low:.2f}, 95 % {high:.2f}, longest {most:.2f}")
    if options.json:
        write_json(options.json, {"surroundings": around, "scenes": found})


if __name__ == "__main__":
    main()
