"""Moving: an arm among balls that would hit it, by one law of control after another."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from itertools import groupby, product
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.task import REACHED_POSITION, REACHED_VELOCITY
from densarm.control.controller import Controller
from densarm.control.evasion import Evasion, EvasionParameters
from densarm.control.passive import PassiveTracking
from densarm.control.replanning import PlanningInLoop, Replanning
from densarm.control.tracking import DensityTracking
from densarm.errors import DensarmError, FileContentError
from densarm.planning.motion import Motion, PlanningError
from densarm.planning.plan import plan_motion
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.study.cluster import as_completed
from densarm.study.evasions import CbfpyEvasion, DamperEvasion, MinkEvasion, StopAndGo
from densarm.study.problems import named_arm
from densarm.study.random_problems import Workspace
from densarm.values.arrays import Array
from densarm.values.checks import non_negative_integer, one_of, positive, positive_integer
from densarm.values.progress import OnProgress
from densarm.world.near_pairs import NearPairs
from densarm.world.world import World

_PERIOD = 0.001  # [s]
_RADIUS = 0.08  # of a ball [m]
_DRAWS = 100
_AIMED_FROM = 3  # the first joint whose links are aimed at
_COLUMN = 0.25  # [m] that balls stay off what joints 1 and 2 alone could move aside
_CLEAR, _OWN_CLEAR = 0.05, 0.01  # [m] that the ends keep from what stands, and links apart
_BEGIN = 0.05, 0.35  # [m] of a ball from the start, and more per m/s up to 1 m/s
_STEP = 1.5  # largest change of a joint [rad]
_TURN = 2.5  # largest angle of start and goal [rad]
_ARRIVAL = 0.3, 1.2  # of the motion's duration, when a ball arrives
_WAY = 0.6, 1.0  # [m] that a ball goes to an arm at rest
_PASSING = 0.6  # [m] that balls go on
_RETURN = 4.0  # [s] for the way back after they passed
_AT_REST = 0.01  # [rad/s]
_PLANNING_TIME, _PATIENCE = 0.1, 0.2  # [s] that planning takes, and that an arm stands before
_POSE_PERIOD, _POSE_NOISE = 0.01, 0.005  # [s], [m] in each axis, where velocities are not told


@dataclass(frozen=True)
class Cell:
    """What trials are drawn alike, but for their seed.

    Raises:
        UnknownNameError: no such arm.
        InvalidValueError: a number out of its range.
        DensarmError: the arm has too few joints.
    """

    arm: str
    """A known name; its links are capsules."""
    obstacles: int
    """Number of balls; from two on there are a table and a wall beside."""
    speed: float
    """Of the balls [m/s]."""
    resting: bool = False
    """Whether the arm is to stay where it is."""
    estimated: bool = False
    """Whether velocities are estimated from positions at 100 Hz that err by 5 mm."""

    def __post_init__(self) -> None:
        positive_integer("obstacles", self.obstacles)
        positive("speed", self.speed)
        if named_arm(self.arm).nv < _AIMED_FROM:
            reason = f"balls are aimed at links from joint {_AIMED_FROM} on, and it has none"
            raise DensarmError(f"robot {self.arm!r}: {reason}")

    @property
    def name(self) -> str:
        """Of the file of its trials."""
        words = [word for word in ("resting", "estimated") if getattr(self, word)]
        return "_".join([self.arm, str(self.obstacles), f"{self.speed:g}", *words])


@dataclass(frozen=True)
class Trial:
    """Balls that hit what follows a motion without giving way."""

    arm: Arm
    scene: Scene
    """What stands, and the balls."""
    motion: Motion
    """Among what stands; of no length for an arm at rest."""
    passed: float
    """When the balls have passed [s]."""


@dataclass(frozen=True)
class Outcomes:
    """What came of a method's trials."""

    trials: int
    contacts: int
    reached: int
    """Without a contact, at the goal and at rest 4 s after the balls have passed."""
    moving_contacts: int
    """Contacts while a joint moved by more than 0.01 rad/s."""
    step_us: float
    """Median of the trials' medians of a control step, processor time [µs]."""


@dataclass(frozen=True)
class _End:
    has_contact: bool
    was_moving: bool
    reached: bool
    step_us: float


def _passive(world: World, motion: Motion) -> PassiveTracking:
    return PassiveTracking(world, motion, world.fastest_obstacle)


def _plan_again(world: World, motion: Motion) -> Replanning:
    """Return what brakes as `StopAndGo`, and plans around where obstacles will be then."""
    arm, tracking = world.arm, DensityTracking(world, motion, evasion=StopAndGo)

    def plan(predicted: World, q: Array) -> Callable[[Array], Controller]:
        found = replace(plan_motion(predicted, q, tracking.goal), world=world)

        def follow(now: Array) -> Controller:
            tracking.follow(found, now)
            return tracking

        return follow

    planner = PlanningInLoop(world, plan, _PLANNING_TIME)
    return Replanning(arm, tracking.goal, tracking, planner, _PATIENCE, period=_PERIOD)


_NEAR = partial(Evasion, parameters=EvasionParameters(horizon=0.0))
METHODS: Mapping[str, Callable[[World, Motion], DensityTracking | PassiveTracking | Replanning]] = {
    "density": DensityTracking,
    "density_near": partial(DensityTracking, evasion=_NEAR),
    "damper_qp": partial(DensityTracking, evasion=DamperEvasion),
    "stop_and_go": partial(DensityTracking, evasion=StopAndGo),
    "plan_again": _plan_again,
    "mink": partial(DensityTracking, evasion=MinkEvasion),
    "cbfpy": partial(DensityTracking, evasion=CbfpyEvasion),
    "passive": _passive,
}
"""What follows a motion; `density_near` looks for no misses ahead."""
PEERS = ("mink", "cbfpy")
"""Methods of other packages of that name."""


def run_trials(
    cell: Cell,
    trials: int,
    seed: int,
    methods: Sequence[str],
    jobs: int = 1,
    save_dir: Path | None = None,
    on_progress: OnProgress = lambda _: None,
    scheduler: str | None = None,
) -> dict[str, Outcomes]:
    """Run the same trials by each of some methods, at 1 kHz.

    Args:
        cell: what they are.
        trials: how many; the first stay the same when there are more.
        seed: of the first trial, the next one's is one more.
        methods: of `METHODS`.
        jobs: processes on this machine.
        save_dir: folder of a file of each cell's runs, which are not run again; None to keep none.
        on_progress: told what is being done.
        scheduler: address of a Dask scheduler whose workers run them, in place of processes here.

    Raises:
        InvalidValueError: a number out of its range, or an unknown method.
        FileContentError: the folder cannot be made, or holds a file of something else.
        DensarmError: no trial was found in many draws, a peer is not installed, or what
            `as_completed` raises.
    """
    positive_integer("trials", trials)
    non_negative_integer("seed", seed)
    for method in methods:
        one_of("methods", method, list(METHODS))
        if method in PEERS and find_spec(method) is None:
            install = "pip install 'densarm[peers]'"
            raise DensarmError(f"method {method!r} needs {method}, not installed: {install}")
    file = save_dir and save_dir / f"{cell.name}.jsonl"
    ends = _kept(file) if file else {}
    items = list(product(range(seed, seed + trials), methods))
    missing = [item for item in items if item not in ends]
    of_seed = [list(some) for _, some in groupby(missing, key=itemgetter(0))]
    with ExitStack() as stack:
        kept = file and stack.enter_context(file.open("a", encoding="utf-8"))
        found = as_completed(partial(_run, cell), of_seed, jobs, scheduler)
        for count, done in enumerate(stack.enter_context(closing(found)), 1):
            ends |= done
            if kept:
                for (number, method), end in done.items():
                    run = {"seed": number, "method": method, **asdict(end)}
                    kept.write(json.dumps(run) + "\n")
                kept.flush()
            on_progress(f"{count} of {len(of_seed)} trials")
    return {
        method: _outcomes([ends[item] for item in items if item[1] == method]) for method in methods
    }


def _outcomes(ends: Sequence[_End]) -> Outcomes:
    return Outcomes(
        len(ends),
        sum(end.has_contact for end in ends),
        sum(end.reached for end in ends),
        sum(end.was_moving for end in ends),
        float(np.median([end.step_us for end in ends])),
    )


def _kept(file: Path) -> dict[tuple[int, str], _End]:
    """Return the runs of a file by seed and method, and make its folder."""
    ends: dict[tuple[int, str], _End] = {}
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        for line in lines:
            told = json.loads(line)
            item = told.pop("seed"), told.pop("method")
            ends[item] = _End(**told)
    except OSError as error:
        raise FileContentError(file, error.strerror or "cannot be made") from None
    except (ValueError, TypeError, LookupError, AttributeError):
        reason = f"line {len(ends) + 1} is no run of a trial: remove it, or the file"
        raise FileContentError(file, reason) from None
    return ends


def to_json(cell: Cell, outcomes: Mapping[str, Outcomes]) -> dict[str, dict[str, Any]]:
    """Return JSON data."""
    methods = {method: asdict(found) for method, found in outcomes.items()}
    return {"cell": asdict(cell), "methods": methods}


def draw_trial(arm: Arm, obstacles: int, speed: float, seed: int, resting: bool = False) -> Trial:
    """Draw start, goal and balls, each aimed at a link where the motion has it when it arrives.

    Balls go through what stands. None touches the arm at first, or hits its column, which cannot
    give way.

    Args:
        arm: its links.
        obstacles: number of balls; from two on there are a table and a wall beside.
        speed: of the balls [m/s].
        seed: of the draws.
        resting: whether the arm is to stay where it is.

    Raises:
        DensarmError: no trial was found in many draws.
    """
    random, workspace = np.random.default_rng([seed, obstacles]), Workspace(arm)
    standing = _furniture(workspace) if obstacles > 1 else Scene()
    world, limits = World(arm, standing), arm.limits
    lower, upper = np.maximum(limits.lower + 0.1, -_TURN), np.minimum(limits.upper - 0.1, _TURN)
    is_own = world.pair_shapes[:, 1] < len(arm.collision_model.geometryObjects)
    keep = np.where(is_own, _OWN_CLEAR, _CLEAR)
    for _ in range(_DRAWS):
        begin = np.clip(arm.angles(workspace.draw(random)), lower, upper)
        end = np.clip(begin + random.uniform(-_STEP, _STEP, arm.nv), lower, upper)
        ends = arm.configurations(begin), arm.configurations(end)
        if any((world.distances(q) < keep).any() for q in ends):
            continue
        motion = Motion(_PERIOD, np.tile(begin, (2, 1)), np.zeros((2, arm.nv)))
        if not resting:
            try:
                motion = plan_motion(world, *ends)
            except PlanningError:
                continue
        if found := _balls(arm, motion, obstacles, speed, random, resting):
            balls, last = found
            passed = max(last + _PASSING / speed, motion.duration)
            return Trial(arm, Scene([*standing, *balls]), motion, passed)
    raise DensarmError(f"robot {arm.name!r}: no trial in {_DRAWS} draws")


def run_trial(trial: Trial, method: str, noise: np.random.Generator | None = None) -> _End:
    """Run one of `METHODS` until something is touched, or the arm is back.

    Args:
        trial: what is run.
        method: its name.
        noise: of positions at 100 Hz, which are all that is told then; None where velocities are
            told as well, every time.
    """
    arm, world = trial.arm, World(trial.arm, trial.scene)
    seen = world if noise is None else World(arm, trial.scene)
    balls = [item for item in trial.scene if item.motion is not None]
    controller = METHODS[method](seen, trial.motion)
    plant, pairs, spent = PinocchioPlant(arm, _PERIOD), NearPairs(world), []
    q, v = arm.configurations(trial.motion.position[0]), np.zeros(arm.nv)
    reached, every = False, round(_POSE_PERIOD / _PERIOD)
    for k in range(round((trial.passed + _RETURN) / _PERIOD)):
        if noise is not None and k % every == 0:
            for ball in balls:
                there = ball.pose_at(k * _PERIOD).translation + noise.normal(0.0, _POSE_NOISE, 3)
                seen.move_obstacle(ball.name, there, time=k * _PERIOD)
        begin = time.process_time()
        u = controller.torque(k * _PERIOD, q, v)
        spent.append(1e6 * (time.process_time() - begin))
        q, v = plant.step(q, v, u)
        world.set_time((k + 1) * _PERIOD)
        if pairs.smallest(q)[0] <= 0.0:
            return _End(True, bool(np.abs(v).max() > _AT_REST), False, float(np.median(spent)))
        off = np.abs(arm.difference(controller.goal, q)).max()
        reached = bool(off <= REACHED_POSITION and np.abs(v).max() <= REACHED_VELOCITY)
        if reached and k * _PERIOD > trial.passed:
            break
    return _End(False, False, reached, float(np.median(spent)))


def _run(cell: Cell, items: Sequence[tuple[int, str]]) -> dict[tuple[int, str], _End]:
    """Run one trial by each method."""
    ends, seed = {}, items[0][0]
    arm = load_arm(cell.arm, shapes="capsule")
    trial = draw_trial(arm, cell.obstacles, cell.speed, seed, cell.resting)
    for _, method in items:
        noise = np.random.default_rng([seed, cell.obstacles, 1]) if cell.estimated else None
        ends[seed, method] = run_trial(trial, method, noise)
    return ends


def _furniture(workspace: Workspace) -> Scene:
    (x, y, z), reach = workspace.centre, workspace.reach
    top = z - 0.15 if z < 0.25 else min(z - 0.3, -0.01)
    far, high = 0.65 * reach, 1.4 * reach
    table = (reach, 1.6 * reach, 0.04), (x + 0.75 * reach, y, top)
    wall = (1.6 * reach, 0.04, high), (x, y + far, top + 0.5 * high)
    return Scene(
        [
            Box(name="table", size=table[0], position=table[1]),
            Box(name="wall", size=wall[0], position=wall[1]),
        ]
    )


def _balls(
    arm: Arm,
    motion: Motion,
    count: int,
    speed: float,
    random: np.random.Generator,
    resting: bool,
) -> tuple[list[Sphere], float] | None:
    """Return the balls, and when the last one arrives [s]; None where many draws were in vain."""
    shapes = arm.collision_model.geometryObjects
    aimed = [k for k, item in enumerate(shapes) if item.parentJoint >= _AIMED_FROM]
    for k in aimed:
        shapes[k].geometry.computeLocalAABB()
    data, placed = arm.model.createData(), arm.collision_model.createData()
    probe = World(arm, Scene([Sphere(name="probe", radius=_RADIUS, position=(0.0, 0.0, 0.0))]))
    to_probe = np.flatnonzero(["probe" in names for names in probe.pairs])
    start = arm.configurations(motion.position[0])
    pin.forwardKinematics(arm.model, data, start)
    column = np.linspace(data.oMi[1].translation, data.oMi[2].translation, 10) + arm.origin
    balls: list[Sphere] = []
    last, clear = 0.0, _BEGIN[0] + _BEGIN[1] * min(speed, 1.0)
    for _ in range(_DRAWS):
        span = np.array(_WAY) / speed if resting else np.array(_ARRIVAL) * motion.duration
        arrival, direction = random.uniform(*span), random.normal(size=3)
        direction /= np.linalg.norm(direction)
        there = arm.configurations(motion.sample(min(arrival, motion.duration)).position)
        pin.updateGeometryPlacements(arm.model, data, arm.collision_model, placed, there)
        k = aimed[random.integers(len(aimed))]
        target = placed.oMg[k].act(np.array(shapes[k].geometry.aabb_center)) + arm.origin
        begin = target + random.uniform(-0.03, 0.03, 3) - arrival * speed * direction
        along = np.clip((column - begin) @ direction, 0.0, arrival * speed + _PASSING)
        off = np.linalg.norm(column - begin - np.outer(along, direction), axis=1).min()
        probe.move_obstacle("probe", begin)
        if off < _RADIUS + _COLUMN or probe.distances(start)[to_probe].min() < clear:
            continue
        way = ConstantVelocity(linear=tuple((speed * direction).tolist()))
        name, position = f"ball_{len(balls)}", tuple(begin.tolist())
        balls.append(Sphere(name=name, radius=_RADIUS, position=position, motion=way))
        last = max(last, arrival)
        if len(balls) == count:
            return balls, last
    return None
