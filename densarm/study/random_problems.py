"""Random problems of an arm: scenes, starts and goals that belong to a seed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import islice

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.dynamics import holding_ratios
from densarm.errors import DensarmError
from densarm.planning.guide import GuidePath, PlanningParameters
from densarm.planning.motion import TimingParameters
from densarm.planning.path_guide import PathGuide
from densarm.scene.loading import MotionProblem
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.study.cluster import in_order
from densarm.study.problems import named_arm
from densarm.values.arrays import Array
from densarm.values.checks import non_negative_integer, one_of, positive_integer
from densarm.values.progress import OnProgress
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.world import World

_SCENES = 200  # drawn for one problem at most
_DRAWS = 3000  # of one end in one scene
_CHECKS = 300  # of those, where the end effector is in its region
_BUDGET = PlanningParameters(iterations=100_000, near_share=0.0, searches=1, shortcuts=1)
_SAMPLES = 1000  # configurations that tell the reach
_BODIES = (3, 8)  # spheres or boxes in a scene, the last number not included
# Lengths are in units of the reach.
_END_MARGIN = 0.005  # that ends keep from contact
_PATH_MARGIN = 0.0025  # that the path keeps that makes a problem solvable
_APART = 0.3  # of the ends' end effectors, at least
_BOARD = 0.02  # thickness of boards
_NEAREST = 0.5  # of the middle of spheres and boxes to the first joint, which they would block
_WIDE = 1.2  # half of a wall's width and height


def random_problems(
    arm: str,
    count: int,
    seed: int,
    scenes: str = "mixed",
    jobs: int = 1,
    on_progress: OnProgress = lambda _: None,
    scheduler: str | None = None,
) -> list[MotionProblem]:
    """Draw problems of an arm among random obstacles, of which each has a solution.

    Starts and goals are drawn evenly within the position limits, continuous joints from a whole
    turn, and kept where the arm touches nothing and can be held, its end effector in the regions
    that the scene asks for and 0.3 of the reach apart. With obstacles, a problem is kept if a
    search of 100,000 samples finds a path that keeps a quarter of a percent of the reach from
    contact, half of what the ends keep: without a margin, chance alone finds passages of less
    than 0.1 mm. The first problems stay the same when more are drawn.

    Args:
        arm: a known name.
        count: number of problems.
        seed: of the draws.
        scenes: one of `SCENE_KINDS`.
        jobs: processes on this machine that search.
        on_progress: told what is being done.
        scheduler: address of a Dask scheduler whose workers search, in place of processes here.

    Raises:
        UnknownNameError: no such arm.
        InvalidValueError: a number of problems below one, a seed that is not a whole number, or
            unknown scenes.
        DensarmError: no problem was found in many scenes, or what `as_completed` raises.
    """
    positive_integer("problems", count)
    non_negative_integer("seed", seed)
    one_of("scenes", scenes, list(SCENE_KINDS))
    named_arm(arm)

    def tell(drawn: int) -> None:
        on_progress(f"{drawn} of {count} problems drawn")

    draw = partial(_draw_problem, arm, scenes, seed)
    return in_order(draw, range(count), jobs, scheduler, tell)


class Workspace:
    """The positions of an arm's end effector, and random configurations that take it there."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._data = arm.model.createData()
        limits, turn = arm.limits, np.where(arm.continuous, np.pi, np.inf)
        self._lower, self._upper = np.maximum(limits.lower, -turn), np.minimum(limits.upper, turn)
        random = np.random.default_rng(0)
        tips = np.array([self.tip(self.draw(random)) for _ in range(_SAMPLES)])
        self.centre: Array = self._data.oMi[1].translation + arm.origin
        """Where the first joint is (3,) [m]."""
        self.reach = float(np.linalg.norm(tips - self.centre, axis=1).max())
        """Largest distance of the end effector from there, of many at random [m]."""

    def draw(self, random: np.random.Generator) -> Array:
        """Return a configuration (nq,) evenly within the limits, continuous joints from a turn."""
        return self.arm.configurations(random.uniform(self._lower, self._upper))

    def tip(self, q: Array) -> Array:
        """Return the position of the end effector (3,) at q (nq,) [m]."""
        frame = self.arm.end_effector_frame
        pin.forwardKinematics(self.arm.model, self._data, q)
        pose = pin.updateFramePlacement(self.arm.model, self._data, frame)
        return np.array(pose.translation) + self.arm.origin


@dataclass(frozen=True)
class Region:
    """A box that stands upright in front of an arm.

    Coordinates are forward, to the left and up, from a point of the arm.
    """

    origin: Array
    """That point (3,) [m]."""
    forward: Array
    """Horizontal direction (3,), of length one."""
    low: Array
    """Lowest coordinates (3,) [m]."""
    high: Array
    """Highest coordinates (3,) [m]."""

    @property
    def axes(self) -> Array:
        """Forward, left and up as rows (3, 3)."""
        up = np.array([0.0, 0.0, 1.0])
        return np.array([self.forward, np.cross(up, self.forward), up])

    def contains(self, x: Array) -> bool:
        """Return whether a point (3,) is inside."""
        at = self.axes @ (x - self.origin)
        return bool(((self.low <= at) & (at <= self.high)).all())

    def solid(self, name: str) -> Box:
        """Return the region as an obstacle."""
        half_turn = 0.5 * np.arctan2(self.forward[1], self.forward[0])
        return Box(
            name=name,
            size=tuple((self.high - self.low).tolist()),
            position=tuple((self.origin + 0.5 * (self.low + self.high) @ self.axes).tolist()),
            orientation_xyzw=(0.0, 0.0, float(np.sin(half_turn)), float(np.cos(half_turn))),
        )


@dataclass(frozen=True)
class RandomScene:
    """Obstacles, and the regions that a motion's ends have their end effector in."""

    scene: Scene
    ends: tuple[Region | None, Region | None] = (None, None)
    """One for each end; None for anywhere."""


def empty(workspace: Workspace, random: np.random.Generator) -> RandomScene:  # noqa: ARG001
    """Return no obstacles."""
    return RandomScene(Scene())


def spheres(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return spheres where the end effector can be, half the reach or more away."""
    balls = [
        Sphere(
            name=f"sphere_{k}",
            radius=workspace.reach * random.uniform(0.05, 0.15),
            position=_somewhere(workspace, random),
        )
        for k in range(random.integers(*_BODIES))
    ]
    return RandomScene(Scene(balls))


def boxes(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return boxes in any orientation where the end effector can be, as far away."""
    crates = []
    for k in range(random.integers(*_BODIES)):
        quaternion = random.normal(size=4)
        crates.append(
            Box(
                name=f"box_{k}",
                size=tuple((workspace.reach * random.uniform(0.08, 0.35, 3)).tolist()),
                position=_somewhere(workspace, random),
                orientation_xyzw=tuple((quaternion / np.linalg.norm(quaternion)).tolist()),
            )
        )
    return RandomScene(Scene(crates))


def wall(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return a wall with a gap, to reach through or to draw back from."""
    front, height = random.uniform(0.35, 0.6), random.uniform(-0.2, 0.5)
    gap = random.uniform(0.2, 0.3, 2)
    left = random.uniform(-0.3, 0.3) * gap[0]
    back = front + _BOARD
    part = _parts(workspace, random)
    sides, lintel = (left - gap[0], left + gap[0]), (height - gap[1], height + gap[1])
    boards = {
        "right": part((front, -_WIDE, -_WIDE), (back, sides[0], _WIDE)),
        "left": part((front, sides[1], -_WIDE), (back, _WIDE, _WIDE)),
        "below": part((front, sides[0], -_WIDE), (back, sides[1], lintel[0])),
        "above": part((front, sides[0], lintel[1]), (back, sides[1], _WIDE)),
    }
    behind = part((back + 0.05, -_WIDE, -_WIDE), (_WIDE, _WIDE, _WIDE))
    before = part((-_WIDE, -_WIDE, -_WIDE), (front, _WIDE, _WIDE))
    return _furnished(boards, (before, behind), random)


def shelf(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return a shelf that stands open to the arm, to reach into or to draw back from."""
    front, deep, wide = random.uniform(0.4, 0.6), random.uniform(0.2, 0.3), random.uniform(0.2, 0.3)
    levels, rise = int(random.integers(2, 4)), random.uniform(0.3, 0.4)
    bottom, back = random.uniform(-0.5, 0.0), front + deep
    top = bottom + levels * rise
    part = _parts(workspace, random)
    boards = {
        "right": part((front, -wide - _BOARD, bottom), (back, -wide, top + _BOARD)),
        "left": part((front, wide, bottom), (back, wide + _BOARD, top + _BOARD)),
        "back": part((back, -wide, bottom), (back + _BOARD, wide, top + _BOARD)),
    }
    for k in range(levels + 1):
        height = bottom + k * rise
        boards[f"board_{k}"] = part((front, -wide, height), (back, wide, height + _BOARD))
    height = bottom + rise * int(random.integers(levels))
    inside = part((front + 0.05, -wide, height), (back, wide, height + rise))
    before = part((-_WIDE, -_WIDE, -_WIDE), (front, _WIDE, _WIDE))
    return _furnished(boards, (before, inside), random)


SceneKind = Callable[[Workspace, np.random.Generator], RandomScene]
Point = tuple[float, float, float]

OBSTACLES: Mapping[str, SceneKind] = {kind.__name__: kind for kind in (spheres, boxes, wall, shelf)}
"""The kinds of scenes with something in them."""

SCENE_KINDS: Mapping[str, tuple[SceneKind, ...]] = {
    "none": (empty,),
    **{name: (kind,) for name, kind in OBSTACLES.items()},
    "mixed": tuple(OBSTACLES.values()),
}
"""Choices of scenes, whose kinds take turns."""


def _somewhere(workspace: Workspace, random: np.random.Generator) -> tuple[float, ...]:
    while True:
        tip = workspace.tip(workspace.draw(random))
        if np.linalg.norm(tip - workspace.centre) >= _NEAREST * workspace.reach:
            return tuple(tip.tolist())


def _parts(workspace: Workspace, random: np.random.Generator) -> Callable[[Point, Point], Region]:
    """Return a maker of regions, given in units of the reach, that face where a tip can be."""
    forward = workspace.tip(workspace.draw(random)) - workspace.centre
    forward[2] = 0.0
    forward /= np.linalg.norm(forward)

    def part(low: Point, high: Point) -> Region:
        return Region(workspace.centre, forward, *(workspace.reach * np.array([low, high])))

    return part


def _furnished(
    boards: Mapping[str, Region], ends: tuple[Region, Region], random: np.random.Generator
) -> RandomScene:
    scene = Scene([region.solid(name) for name, region in boards.items()])
    return RandomScene(scene, ends if random.integers(2) else ends[::-1])


def _draw_problem(arm: str, scenes: str, seed: int, index: int) -> MotionProblem:
    workspace, random = _workspace(arm), np.random.default_rng([seed, index])
    kinds = SCENE_KINDS[scenes]
    kind = kinds[index % len(kinds)]
    for _ in range(_SCENES):
        found = kind(workspace, random)
        world = World(workspace.arm, found.scene)
        start, goal = (_draw_end(workspace, world, region, random) for region in found.ends)
        if start is None or goal is None:
            continue
        apart = np.linalg.norm(workspace.tip(goal) - workspace.tip(start))
        margin = _PATH_MARGIN * workspace.reach
        if apart >= _APART * workspace.reach and _has_path(world, start, goal, margin, seed):
            return MotionProblem(
                robot=arm,
                scene_name=kind.__name__,
                index=index,
                joints=workspace.arm.joint_names,
                start=tuple(workspace.arm.angles(start).tolist()),
                goal=tuple(workspace.arm.angles(goal).tolist()),
                locked_joints={},
                scene=found.scene,
            )
    raise DensarmError(f"robot {arm!r}: no problem with a solution in {_SCENES} random scenes")


@lru_cache(maxsize=1)
def _workspace(arm: str) -> Workspace:
    return Workspace(named_arm(arm))


def _draw_end(
    workspace: Workspace,
    world: World,
    region: Region | None,
    random: np.random.Generator,
) -> Array | None:
    arm, margin = workspace.arm, _END_MARGIN * workspace.reach
    draws = (workspace.draw(random) for _ in range(_DRAWS))
    inside = (q for q in draws if region is None or region.contains(workspace.tip(q)))
    for q in islice(inside, _CHECKS):
        is_held = holding_ratios(arm, q).max() <= TimingParameters().torque_share
        if is_held and world.distances(q).min(initial=np.inf) > margin:
            return q
    return None


def _has_path(world: World, start: Array, goal: Array, margin: float, seed: int) -> bool:
    if not len(world.scene):
        return True
    guide = PathGuide(world.arm, SeparatingPlanes(world, margin), _BUDGET)
    return isinstance(guide.plan(start, goal, seed), GuidePath)
