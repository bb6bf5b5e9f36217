"""Problem: a start and a goal of an arm in a scene, as plain data that a process can be sent."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from densarm.arm import Arm, load_arm
from densarm.clear_configurations import clear_configurations
from densarm.clearance import Clearance
from densarm.errors import InvalidValueError
from densarm.scenario import Scenario
from densarm.scene import Scene
from densarm.scene_files import MotionProblem
from densarm.validation import non_negative_integer, positive_integer


@dataclass(frozen=True)
class Problem:
    """One motion to plan and run."""

    arm: str
    """A known name."""
    scene_name: str
    """The set that the problem belongs to."""
    index: int
    """Its place in the set."""
    scene: Scene
    start: tuple[float, ...]
    """Joint positions, one number per joint [rad or m]."""
    goal: tuple[float, ...]
    """Joint positions, one number per joint [rad or m]."""
    seed: int = 0
    """Of the planner."""
    locked_joints: tuple[tuple[str, float], ...] = ()
    """Names and positions of joints that stand still [rad or m]."""

    def scenario(self) -> Scenario:
        """Return the problem as a scenario with default parameters.

        Raises:
            UnknownNameError: no such arm, or joint to lock.
        """
        arm = _arm(self.arm, self.locked_joints)
        name = f"{self.arm}_{self.scene_name}_{self.index}"
        return Scenario(
            name=name,
            title=name,
            arm=arm,
            scene=self.scene,
            start=arm.configuration(self.start),
            goal=arm.configuration(self.goal),
            seed=self.seed,
        )


@lru_cache(maxsize=1)
def _arm(name: str, locked_joints: tuple[tuple[str, float], ...] = ()) -> Arm:
    return load_arm(name, locked_joints=dict(locked_joints))


def as_problems(collection: Iterable[MotionProblem]) -> list[Problem]:
    """Return problems of MotionBenchMaker's collection.

    Args:
        collection: problems of robots that are known by name.

    Raises:
        UnknownNameError: no such robot, or joint to lock.
        InvalidValueError: a problem does not give each joint of the robot one position.
    """
    return [_of_collection(problem) for problem in collection]


def _of_collection(problem: MotionProblem) -> Problem:
    locked = tuple(sorted(problem.locked_joints.items()))
    names = _arm(problem.robot, locked).joint_names
    if sorted(problem.joints) != sorted(names):
        allowed = f"the joints of {problem.robot}, {', '.join(names)}"
        raise InvalidValueError("metadata.joints", list(problem.joints), allowed)
    order = [problem.joints.index(name) for name in names]
    return Problem(
        arm=problem.robot,
        scene_name=problem.scene_name,
        index=problem.index,
        scene=problem.scene,
        start=tuple(problem.start[k] for k in order),
        goal=tuple(problem.goal[k] for k in order),
        locked_joints=locked,
    )


def random_problems(arm: str, count: int, seed: int) -> list[Problem]:
    """Draw problems without obstacles, in which an arm may collide with itself alone.

    Starts and goals are drawn evenly within the position limits, continuous joints from a whole
    turn, until nothing touches. The first problems stay the same when more are drawn.

    Args:
        arm: a known name.
        count: number of problems.
        seed: of the draws and of the planner.

    Raises:
        UnknownNameError: no such arm.
        InvalidValueError: a number of problems below one, or a seed that is not a whole number.
        DensarmError: almost no configuration is clear.
    """
    positive_integer("problems", count)
    non_negative_integer("seed", seed)
    loaded, scene = _arm(arm), Scene([])
    ends = clear_configurations(Clearance(loaded, scene), 2 * count, seed)
    angles = [tuple(row) for row in loaded.angles(np.array(ends)).tolist()]
    pairs = zip(angles[::2], angles[1::2], strict=True)
    return [Problem(arm, "empty", k, scene, *pair, seed) for k, pair in enumerate(pairs)]
