"""Moving: an arm among balls that would hit it, by one law of control after another."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.control.controller import Controller
from densarm.control.tracking import DensityTracking
from densarm.errors import DensarmError
from densarm.planning.motion import Motion, PlanningError
from densarm.planning.plan import plan_motion
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.study.random_problems import Workspace
from densarm.values.arrays import Array
from densarm.world.near_pairs import NearPairs
from densarm.world.world import World

_RADIUS = 0.08  # of a ball [m]
_DRAWS = 100
_AIMED_FROM = 3  # the first joint whose links are aimed at
_CLEAR = 0.05  # [m] of the ends from what stands, and of balls from the start
_STEP = 1.5  # largest change of a joint [rad]
_LATEST = (0.3, 1.2)  # share of the motion at which a ball arrives
_FAR = 1.0  # [m] that a ball goes before it hits a resting arm
_SLOWEST = 0.1
_PASS = 0.6  # [m] that a ball goes on after it would have hit


@dataclass(frozen=True)
class Trial:
    arm: Arm
    scene: Scene
    motion: Motion
    duration: float


def draw_trial(arm: Arm, obstacles: int, speed: float, seed: int, resting: bool = False) -> Trial:
    random = np.random.default_rng([seed, obstacles])
    workspace = Workspace(arm)
    static = _furniture(workspace) if obstacles > 1 else Scene()
    world = World(arm, static)
    for _ in range(_DRAWS):
        start = workspace.draw(random)
        step = random.uniform(-_STEP, _STEP, arm.nv)
        limits = arm.limits
        turn = np.where(arm.continuous, np.inf, 1.0)
        low, high = limits.lower + 0.1, limits.upper - 0.1
        angles = np.clip(arm.angles(start), np.maximum(low, -2.5), np.minimum(high, 2.5))
        start = arm.configurations(angles)
        goal = arm.configurations(np.clip(angles + step, low * turn, high * turn))
        if min(world.distances(start).min(initial=9), world.distances(goal).min(initial=9)) < _CLEAR:
            continue
        if resting:
            motion = Motion(0.001, np.tile(arm.angles(start), (2, 1)), np.zeros((2, arm.nv)))
        else:
            try:
                motion = plan_motion(world, start, goal)
            except PlanningError:
                continue
        if found := _balls(world, motion, obstacles, speed, random, resting):
            balls, last = found
            scene = Scene([*static, *balls])
            end = max(last + _PASS / speed, motion.duration) + 4.0
            return Trial(arm, scene, motion, end)
    raise DensarmError(f"seed {seed}: no trial")


def _furniture(workspace: Workspace) -> Scene:
    c, r = workspace.centre, workspace.reach
    floor = min(c[2] - 0.3, -0.01) if c[2] > 0.25 else c[2] - 0.15
    table = Box(name="table", size=(1.0 * r, 1.6 * r, 0.04), position=(c[0] + 0.75 * r, c[1], floor))
    wall = Box(name="wall", size=(1.6 * r, 0.04, 1.4 * r), position=(c[0], c[1] + 0.65 * r, floor + 0.7 * r))
    return Scene([table, wall])


def _balls(world, motion, count, speed, random, resting):
    arm = world.arm
    shapes = arm.collision_model.geometryObjects
    aimed = [k for k, item in enumerate(shapes) if item.parentJoint >= _AIMED_FROM]
    for k in aimed:
        shapes[k].geometry.computeLocalAABB()
    data, placed = arm.model.createData(), arm.collision_model.createData()
    probe = World(arm, Scene([Sphere(name="ball", radius=_RADIUS, position=(0.0, 0.0, 0.0))]))
    start = arm.configurations(motion.position[0])
    pin.forwardKinematics(arm.model, data, start)
    foot = arm.origin + arm.model.jointPlacements[1].translation
    shoulder = data.oMi[2].translation + arm.origin
    column = np.linspace(foot, shoulder, 10)
    balls, last = [], 0.0
    clear = _CLEAR + 0.35 * min(speed, 1.0)
    for _ in range(_DRAWS):
        t = random.uniform(*_LATEST) * motion.duration
        if resting:
            t = _FAR / speed * random.uniform(0.6, 1.0)
        direction = random.normal(size=3)
        direction /= np.linalg.norm(direction)
        q = arm.configurations(motion.sample(min(t, motion.duration)).position)
        pin.updateGeometryPlacements(arm.model, data, arm.collision_model, placed, q)
        k = aimed[random.integers(len(aimed))]
        target = placed.oMg[k].act(np.array(shapes[k].geometry.aabb_center)) + arm.origin
        target += random.uniform(-0.03, 0.03, 3)
        begin = target - t * speed * direction
        along = np.clip((column - begin) @ direction, 0.0, t * speed + _PASS)
        off = np.linalg.norm(column - begin - np.outer(along, direction), axis=1).min()
        if off < _RADIUS + 0.25:
            continue
        probe.move_obstacle("ball", begin)
        if probe.clearance(start).distance[probe_pairs(probe)].min() < clear:
            continue
        balls.append(
            Sphere(
                name=f"ball_{len(balls)}",
                radius=_RADIUS,
                position=tuple(begin),
                motion=ConstantVelocity(linear=tuple(speed * direction)),
            )
        )
        last = max(last, t)
        if len(balls) == count:
            return balls, last
    return None


def probe_pairs(world):
    return [k for k, names in enumerate(world.pairs) if "ball" in names]


def run_trial(trial: Trial, make, dt=0.001):
    world = World(trial.arm, trial.scene)
    controller = make(world, trial.motion)
    plant = PinocchioPlant(trial.arm, dt)
    near = NearPairs(world)
    q = trial.arm.configurations(trial.motion.position[0])
    v = np.zeros(trial.arm.nv)
    goal = controller.goal
    spent = []
    for k in range(round(trial.duration / dt)):
        begin = time.perf_counter()
        u = controller.torque(k * dt, q, v)
        spent.append(time.perf_counter() - begin)
        q, v = plant.step(q, v, u)
        world.set_time((k + 1) * dt)
        d, pair = near.smallest(q)
        if d <= 0.0:
            return dict(contact=True, moving=bool(np.abs(v).max() > 0.01), reached=False, t=(k + 1) * dt, pair=world.pairs[pair], step=float(np.median(spent)*1e6))
        if k % 50 == 0 and k * dt > trial.duration - 4.0:
            err = np.abs(trial.arm.difference(q, goal)).max()
            if err < 0.01 and np.abs(v).max() < 0.01:
                break
    err = np.abs(trial.arm.difference(q, goal)).max()
    return dict(contact=False, moving=False, reached=bool(err < 0.01 and np.abs(v).max() < 0.01), t=trial.duration, err=float(err), step=float(np.median(spent)*1e6))
