"""The cost of one control step, against the calls of Pinocchio and coal that it cannot avoid."""

import gc
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import cycle, islice
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm, load_arm
from densarm.control.evasion import Evasion
from densarm.control.tracking import DensityTracking
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.checks import non_negative_integer, positive_integer
from densarm.world.pair_queries import COAL_TOLERANCE
from densarm.world.world import World

_PERIOD = 0.001  # of the swing [s]
_DURATION = 2.0  # [s]
_AMPLITUDE = 0.3  # [rad or m]
_RADIUS = 0.05  # of spheres [m]
_NEAREST = 0.02  # distance from a sphere to the arm, at least [m]
_CANDIDATES = 50  # per sphere
_FAR = (0.0, 0.0, 100.0)  # position of what is in nobody's way [m]
_OFF_MOTION = 1e-3  # of the states in every joint [rad or m]
_AWAY, _BACK_AGAIN = (0.1, 0.3), 1.0  # [m] off its place that a sphere goes to and fro, and [s]
# States between two turns: so many that the first of a turn, which finds nothing in the caches,
# does not matter to the 99.9 %; no divisor of a visit to all, so that turns shift.
_BLOCK = 4999
_PERCENT = (50.0, 99.0, 99.9)
_THIS_THREAD = getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF)  # macOS has the second

Step = Callable[[float, Array, Array], object]
State = tuple[float, Array, Array]


@dataclass(frozen=True)
class StepTiming:
    """Times of one control step along a motion.

    The bare calls are what Pinocchio and coal do for a step that asks for the distances of all
    pairs: computeJointJacobians, updateGeometryPlacements, computeDistances and rnea.
    """

    step_us: float
    """The whole `controller.torque`, median [µs]."""
    bare_us: float
    """The bare calls on all pairs, median [µs]."""
    ratio: float
    """The first in units of the second."""
    pairs: int
    """Geometry pairs."""
    steps: int
    """Timed steps, and as many turns of the bare calls."""
    step_percentiles_us: list[float]
    """50, 99 and 99.9 % of the step, in processor time of its thread [µs]."""
    bare_percentiles_us: list[float]
    """The same of the bare calls [µs]."""
    undisturbed_percentiles_us: list[float]
    """As `step_percentiles_us`, of the least time that each state took in all its visits: without
    what other processes do to caches and clocks. A visit to all states takes 4002 steps [µs]."""
    steady_percentiles_us: list[float] | None
    """As `step_percentiles_us`, of the steps that follow a step directly: not the first of a turn,
    nor one in or before which another process had the core. Whatever else runs takes the caches,
    and the next step fetches all again [µs]. None if there was no such step."""
    resumed_us: float
    """The first step of a turn, after the bare calls have had the caches: median [µs]."""
    switches: int
    """How often another process took the core from the steps."""
    memory_growth_kb: float
    """By how much the process's peak memory grew during the steps [kB]."""
    collections: int
    """Runs of Python's garbage collector during the steps."""
    moving: int = 0
    """How many of the spheres move in a third turn, in which the arm evades."""
    evading_us: float | None = None
    """The whole `controller.torque` then, median [µs]; moving the spheres is not timed."""
    evading_ratio: float | None = None
    """The same in units of `step_us`."""
    evading_percentiles_us: list[float] | None = None
    """As `step_percentiles_us`, of these steps [µs]."""


def time_step(
    arm: str, shapes: str = "hull", pairs: int = 64, steps: int = 20_000, moving: int = 0
) -> StepTiming:
    """Time one control step of the tracking controller.

    The arm swings to and fro among spheres that it passes closely, at 1 kHz, so that pairs wake
    and fall asleep as they do at work.

    Args:
        arm: a known name.
        shapes: "hull", "pieces" or "capsule".
        pairs: geometry pairs: arm to sphere, filled up by the arm's own.
        steps: number of steps to be timed.
        moving: how many of the spheres move in a third turn, up to 0.6 m/s; zero for none.

    Raises:
        UnknownNameError: no such arm or shapes.
        InvalidValueError: a number of pairs that the arm cannot have, of steps below 1, or of
            spheres that there are not.
    """
    steps, moving = positive_integer("steps", steps), non_negative_integer("moving", moving)
    loaded = load_arm(arm, shapes=shapes)
    motion = swing(loaded)
    world = world_among_spheres(loaded, motion, pairs)
    turns: list[Step] = [full_sensing_controller(world, motion).torque, _bare_calls(world)]
    moves: list[Callable[[float], object]] = [_rest, _rest]
    if moving:
        around = world_among_spheres(loaded, motion, pairs)
        turns.append(full_sensing_controller(around, motion, moving).torque)
        moves.append(_to_and_fro(around, moving))
    times = motion.period * np.arange(len(motion.position))
    q = loaded.configurations(motion.position + _OFF_MOTION)
    states = list(zip(times.tolist(), q, motion.velocity, strict=True))
    period, to_and_fro = 2 * len(states), cycle([*states, *states[::-1]])
    record = np.full((len(turns), 3, steps), np.nan)  # pages are touched here
    for calls, move in zip(turns, moves, strict=True):  # to warm up
        _time(calls, states, np.empty((3, len(states))), move)
    memory, collections = _peak_memory(), _collections()
    for begin in range(0, steps, _BLOCK):
        block = list(islice(to_and_fro, min(_BLOCK, steps - begin)))
        for calls, of_calls, move in zip(turns, record, moves, strict=True):
            _time(calls, block, of_calls[:, begin:], move)
    (step_us, bare_us, *evading), (step, bare) = (
        1e6 * np.median(record[:, 0], axis=1),
        record[:2, 1],
    )
    least = np.full(min(steps, period), np.inf)
    np.minimum.at(least, np.arange(steps) % period, step)
    switches = record[0, 2]
    follows = (switches == 0.0) & (np.roll(switches, 1) == 0.0)
    follows[::_BLOCK] = False
    return StepTiming(
        step_us=float(step_us),
        bare_us=float(bare_us),
        ratio=float(step_us / bare_us),
        pairs=world.n_pairs,
        steps=steps,
        step_percentiles_us=_percentiles(step),
        bare_percentiles_us=_percentiles(bare),
        undisturbed_percentiles_us=_percentiles(least),
        steady_percentiles_us=_percentiles(step[follows]) if follows.any() else None,
        resumed_us=_percentiles(step[::_BLOCK])[0],
        switches=int(switches.sum()),
        memory_growth_kb=_peak_memory() - memory,
        collections=_collections() - collections,
        moving=moving,
        evading_us=float(evading[0]) if evading else None,
        evading_ratio=float(evading[0] / step_us) if evading else None,
        evading_percentiles_us=_percentiles(record[2, 1]) if evading else None,
    )


@dataclass(frozen=True)
class FirstCall:
    """Times of a controller in a new process."""

    preparation_s: float
    """Making the controller and its density, which loads or compiles every kernel [s]."""
    torque_us: float
    """Its first `torque`, in which all pairs are queried [µs]."""


def time_first_calls(
    arm: str, shapes: str = "hull", pairs: int = 64
) -> tuple[FirstCall, FirstCall]:
    """Time the first call in two new processes, with nothing compiled and with it on disk.

    Arguments are those of `time_step`.
    """
    command = [sys.executable, "-m", "densarm.study.step", arm, shapes, str(pairs)]
    with TemporaryDirectory() as folder:
        env = {**os.environ, "NUMBA_CACHE_DIR": folder}
        compiled, loaded = (
            FirstCall(**json.loads(subprocess.check_output(command, env=env))) for _ in range(2)
        )
    return compiled, loaded


def swing(arm: Arm) -> Motion:
    """Return a swing of every joint about zero, or as near to it as its limits allow."""
    limits = arm.limits
    middle = np.clip(0.0, limits.lower + _AMPLITUDE, limits.upper - _AMPLITUDE)
    t = np.arange(0.0, _DURATION + _PERIOD / 2.0, _PERIOD)[:, np.newaxis]
    rate = np.pi / _DURATION
    position = middle - _AMPLITUDE * np.cos(rate * t)
    return Motion(_PERIOD, position, _AMPLITUDE * rate * np.sin(rate * t) * np.ones(arm.nv))


def world_among_spheres(arm: Arm, motion: Motion, pairs: int) -> World:
    """Return an arm among spheres that its motion passes closely, with as many pairs as asked for.

    They are pairs of arm and sphere, filled up by the arm's own, of which it keeps no more.

    Raises:
        InvalidValueError: a number of pairs that the arm cannot have.
    """
    geometry = arm.collision_model
    whole = [item for item in geometry.geometryObjects if item.name not in arm.self_pieces]
    moving = sum(item.parentJoint > 0 for item in whole)
    own = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    n_spheres, n_own = divmod(pairs, moving)
    if n_own > len(own):
        allowed = f"{moving} (the arm's moving shapes) times a number, plus at most {len(own)}"
        raise InvalidValueError("pairs", pairs, allowed)
    geometry.removeAllCollisionPairs()
    scene = Scene(_spheres(arm, motion, n_spheres))
    for pair in own[:n_own]:
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    return World(arm, scene)


def full_sensing_controller(world: World, motion: Motion, moving: int = 0) -> DensityTracking:
    """Return a controller that senses every obstacle as far as it does by default.

    Sensing distances are a share of what the motion keeps from an obstacle; these come when the
    controller has been made, and are left where they were. Where some are to move, those alone do,
    and the controller evades them.
    """
    scene = world.scene
    for obstacle in scene.obstacles[:moving] if moving else scene:
        world.move_obstacle(obstacle.name, _FAR)
    controller = DensityTracking(world, motion, evasion=Evasion if moving else _Standing)
    world.change_to(scene)
    return controller


class _Standing(Evasion):
    """Takes obstacles that were moved for ones that stand."""

    def is_needed(self) -> bool:
        """Return that none moves."""
        return False


def _rest(t: float) -> None:
    """Move nothing."""


def _to_and_fro(world: World, moving: int) -> Callable[[float], None]:
    """Return what moves the first spheres away from the arm's base and back, at a time [s].

    Raises:
        InvalidValueError: fewer spheres.
    """
    spheres = world.scene.obstacles
    if moving > len(spheres):
        raise InvalidValueError("moving", moving, f"at most {len(spheres)}, the spheres there are")
    names = [sphere.name for sphere in spheres[:moving]]
    places = np.array([sphere.position for sphere in spheres[:moving]])
    ways = places / np.linalg.norm(places, axis=1, keepdims=True)
    begin, end = _AWAY
    rate = 2.0 * np.pi / _BACK_AGAIN

    def move(t: float) -> None:
        off = begin + 0.5 * (end - begin) * (1.0 - np.cos(rate * t))
        speed = 0.5 * (end - begin) * rate * np.sin(rate * t)
        for name, place, way in zip(names, places, ways, strict=True):
            world.move_obstacle(name, place + off * way, velocity=speed * way)

    return move


def _percentiles(seconds: Array) -> list[float]:
    """Return the 50, 99 and 99.9 % [µs] of times [s]."""
    return [float(1e6 * time) for time in np.percentile(seconds, _PERCENT)]


def _time(
    step: Step, states: list[State], out: Array, move: Callable[[float], object] = _rest
) -> None:
    """Time every call by itself, obstacles having been moved before.

    Into `out` (3, at least N) go wall and processor time of each, and how often another process
    took the core in it or between it and the one before.
    """
    before = _switches()
    for k, state in enumerate(states):
        move(state[0])
        began_processor = time.thread_time()
        began = time.perf_counter()
        step(*state)
        out[0, k] = time.perf_counter() - began
        out[1, k] = time.thread_time() - began_processor
        after = _switches()
        out[2, k] = after - before
        before = after


def _switches() -> int:
    """Return how often the scheduler took the core from this thread."""
    return resource.getrusage(_THIS_THREAD).ru_nivcsw


def _peak_memory() -> float:
    """Return the largest resident memory of the process so far [kB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1024.0 if sys.platform == "darwin" else float(peak)


def _collections() -> int:
    return sum(generation["collections"] for generation in gc.get_stats())


def _bare_calls(world: World) -> Step:
    model, geometry = world.arm.model, world.geometry_model
    data, geometry_data = model.createData(), geometry.createData()
    for request in geometry_data.distanceRequests:
        request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE
    acceleration = np.zeros(model.nv)

    def call(t: float, q: Array, v: Array) -> None:  # noqa: ARG001
        pin.computeJointJacobians(model, data, q)
        pin.updateGeometryPlacements(model, data, geometry, geometry_data)
        pin.computeDistances(geometry, geometry_data)
        pin.rnea(model, data, q, v, acceleration)

    return call


def _time_first_call(name: str, shapes: str, pairs: int) -> FirstCall:
    arm = load_arm(name, shapes=shapes)
    motion = swing(arm)
    world = world_among_spheres(arm, motion, pairs)
    q, v = arm.configurations(motion.position[:1])[0], np.zeros(arm.nv)
    began = time.perf_counter()
    controller = full_sensing_controller(world, motion)
    made = time.perf_counter()
    controller.torque(0.0, q, v)
    called = time.perf_counter()
    return FirstCall(made - began, 1e6 * (called - made))


def _spheres(arm: Arm, motion: Motion, count: int) -> list[Sphere]:
    """Return the spheres, out of many at random, that an arm without own pairs passes closest."""
    random = np.random.default_rng(0)
    q = arm.configurations(motion.position[:: len(motion.position) // 10])
    data, geometry = arm.model.createData(), arm.collision_model
    geometry_data = geometry.createData()
    moved = World(arm, Scene([Sphere(name="sphere", radius=_RADIUS)]))
    candidates, passing = [], []
    for k in range(_CANDIDATES * count):
        pin.updateGeometryPlacements(arm.model, data, geometry, geometry_data, q[k % len(q)])
        body = geometry_data.oMg[int(random.integers(geometry.ngeoms))].translation
        direction = random.normal(size=3)
        offset = random.uniform(0.1, 0.4) * direction / np.linalg.norm(direction)
        position = tuple((body + offset).tolist())
        candidates.append(Sphere(name=f"sphere_{k}", radius=_RADIUS, position=position))
        moved.move_obstacle("sphere", position)
        passing.append(min(moved.distances(row).min() for row in q))
    distance = np.array(passing)
    clear = np.flatnonzero(distance >= _NEAREST)
    return [candidates[k] for k in clear[np.argsort(distance[clear])][:count]]


if __name__ == "__main__":
    name, shapes, pairs = sys.argv[1:]
    sys.stdout.write(json.dumps(asdict(_time_first_call(name, shapes, int(pairs)))))
