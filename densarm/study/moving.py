"""Moving: an arm among balls that would hit it, by one law of control after another."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.task import REACHED_POSITION, REACHED_VELOCITY
from densarm.control.evasion import Evasion, EvasionParameters
from densarm.control.passive import PassiveTracking
from densarm.control.tracking import DensityTracking
from densarm.errors import DensarmError
from densarm.planning.motion import Motion, PlanningError
from densarm.planning.plan import plan_motion
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.study.problems import in_processes, named_arm
from densarm.study.random_problems import Workspace
from densarm.values.arrays import Array
from densarm.values.checks import non_negative_integer, one_of, positive, positive_integer
from densarm.world.distance_view import add_pair_gradients, pair_rates
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
    """Median of the trials' medians of a control step [µs]."""


@dataclass(frozen=True)
class _End:
    has_contact: bool
    was_moving: bool
    reached: bool
    step_us: float


class DamperEvasion(Evasion):
    """The velocity-damper QP: ∇d_k · q̇ + n_k · w_k ≥ -ξ (d_k - m) for pairs within reach.

    ξ = 3 /s, m = 20 mm and a reach of 0.5 m are the best of five settings that were tried; servo,
    bounds and nominal velocity are those of `Evasion`.

    Source: B. Faverjon, P. Tournassoud, A Local Based Approach for Path Planning of Manipulators
        with a High Number of Degrees of Freedom, ICRA 1987.
    """

    def _write_rows(self, v: Array, angles: Array) -> None:  # noqa: ARG002
        pairs, world, n = self._pairs, self._world, self._arm.nv
        np.maximum(pairs.reach, _DAMPER_REACH, out=pairs.reach)
        near = np.flatnonzero((pairs.state != 0) & (pairs.rows[:, 0] < _DAMPER_REACH))
        rows, table = np.ascontiguousarray(pairs.rows[near]), self._rows[: len(near)]
        slopes = np.zeros((len(near), n))
        add_pair_gradients(rows, pairs.kinematics.jacobian, world.sign[near], slopes)
        table[:, :n] = slopes
        rate = pair_rates(rows, world.twist[near])
        table[:, n] = -_DAMPER * (rows[:, 0] - _DAMPER_MARGIN) - rate
        self._count[0] = len(near)


class StopAndGo(Evasion):
    """Stops while anything that moves is near, and goes on when it is not."""

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:
        """Act as `Evasion.velocity`."""
        moving = self._is_moving & (self._pairs.state != 0)
        near = bool((self._pairs.rows[moving, 0] < _STOP_DISTANCE).any())
        return super().velocity(q, v, 0.0 * nominal if near else nominal)[0], near

    def _write_rows(self, v: Array, angles: Array) -> None:
        """Write none."""


_DAMPER, _DAMPER_REACH, _DAMPER_MARGIN = 3.0, 0.5, 0.02  # [1/s], [m], [m]
_STOP_DISTANCE = 0.3  # [m]


def _passive(world: World, motion: Motion) -> PassiveTracking:
    return PassiveTracking(world, motion, world.fastest_obstacle)


_NEAR = partial(Evasion, parameters=EvasionParameters(horizon=0.0))
METHODS: Mapping[str, Callable[[World, Motion], DensityTracking | PassiveTracking]] = {
    "density": DensityTracking,
    "density_near": partial(DensityTracking, evasion=_NEAR),
    "damper_qp": partial(DensityTracking, evasion=DamperEvasion),
    "stop_and_go": partial(DensityTracking, evasion=StopAndGo),
    "passive": _passive,
}
"""What follows a motion; `density_near` looks for no misses ahead."""


def run_trials(
    arm: str,
    obstacles: int,
    speed: float,
    trials: int,
    seed: int,
    methods: Sequence[str],
    resting: bool = False,
    jobs: int = 1,
    on_progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Outcomes]:
    """Run the same trials by each of some methods, at 1 kHz and with velocities told.

    Args:
        arm: a known name; its links are capsules.
        obstacles: number of balls; from two on there are a table and a wall beside.
        speed: of the balls [m/s].
        trials: how many; the first stay the same when there are more.
        seed: of the first trial, the next one's is one more.
        methods: of `METHODS`.
        resting: whether the arm is to stay where it is.
        jobs: processes.
        on_progress: told what is being done.

    Raises:
        UnknownNameError: no such arm.
        InvalidValueError: a number out of its range, or an unknown method.
        DensarmError: no trial was found in many draws.
    """
    for name, value in (("obstacles", obstacles), ("trials", trials)):
        positive_integer(name, value)
    positive("speed", speed)
    non_negative_integer("seed", seed)
    for method in methods:
        one_of("methods", method, list(METHODS))
    named_arm(arm)
    items = list(product(range(seed, seed + trials), methods))
    ends: dict[str, list[_End]] = {method: [] for method in methods}
    work = partial(_run, arm, obstacles, speed, resting)
    for (_, method), end in zip(items, in_processes(work, items, jobs), strict=False):
        ends[method].append(end)
        on_progress(f"{sum(map(len, ends.values()))} of {len(items)} runs")
    return {
        method: Outcomes(
            len(found),
            sum(end.has_contact for end in found),
            sum(end.reached for end in found),
            sum(end.was_moving for end in found),
            float(np.median([end.step_us for end in found])),
        )
        for method, found in ends.items()
    }


def to_json(outcomes: Mapping[str, Outcomes]) -> dict[str, dict[str, dict[str, float]]]:
    """Return JSON data."""
    return {"methods": {method: asdict(found) for method, found in outcomes.items()}}


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


def run_trial(trial: Trial, method: str) -> _End:
    """Run one of `METHODS` until something is touched, or the arm is back."""
    arm, world = trial.arm, World(trial.arm, trial.scene)
    controller = METHODS[method](world, trial.motion)
    plant, pairs, spent = PinocchioPlant(arm, _PERIOD), NearPairs(world), []
    q, v = arm.configurations(trial.motion.position[0]), np.zeros(arm.nv)
    reached = False
    for k in range(round((trial.passed + _RETURN) / _PERIOD)):
        begin = time.perf_counter()
        u = controller.torque(k * _PERIOD, q, v)
        spent.append(1e6 * (time.perf_counter() - begin))
        q, v = plant.step(q, v, u)
        world.set_time((k + 1) * _PERIOD)
        if pairs.smallest(q)[0] <= 0.0:
            return _End(True, bool(np.abs(v).max() > _AT_REST), False, float(np.median(spent)))
        off = np.abs(arm.difference(controller.goal, q)).max()
        reached = bool(off <= REACHED_POSITION and np.abs(v).max() <= REACHED_VELOCITY)
        if reached and k * _PERIOD > trial.passed:
            break
    return _End(False, False, reached, float(np.median(spent)))


def _run(arm: str, obstacles: int, speed: float, resting: bool, item: tuple[int, str]) -> _End:
    seed, method = item
    return run_trial(_trial(arm, obstacles, speed, seed, resting), method)


def _trial(arm: str, obstacles: int, speed: float, seed: int, resting: bool) -> Trial:
    key = arm, obstacles, speed, seed, resting
    if key not in _drawn:  # the last one alone is asked for again, by the next method
        _drawn.clear()
        _drawn[key] = draw_trial(load_arm(arm, shapes="capsule"), obstacles, speed, seed, resting)
    return _drawn[key]


_drawn: dict[tuple[str, int, float, int, bool], Trial] = {}


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
