"""Problem: a start and a goal of an arm in a scene, as plain data that a process can be sent."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from densarm.arm import Arm, load_arm
from densarm.errors import InvalidValueError
from densarm.scenario import Scenario
from densarm.scene import Scene
from densarm.scene_files import MotionProblem


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
        arm = named_arm(self.arm, self.locked_joints)
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
def named_arm(name: str, locked_joints: tuple[tuple[str, float], ...] = ()) -> Arm:
    """Return an arm by its name, the same one when it is asked for again.

    Args:
        name: a known name.
        locked_joints: names and positions of joints that stand still [rad or m].

    Raises:
        UnknownNameError: no such arm, or joint to lock.
    """
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
    names = named_arm(problem.robot, locked).joint_names
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
