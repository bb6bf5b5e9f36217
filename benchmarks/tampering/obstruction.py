"""Ways to put something in the way of a run."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from densarm import Box, Cylinder, Run, Scene, Sphere, World
from densarm.scene.obstacles import Obstacle
from densarm.values.arrays import Array
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from tampering.kind import NotPossibleError, exponent, regridded, with_task


def inside_a_body(run: Run, q: Array, rng: np.random.Generator, corner: bool = False) -> Array:
    """Return a point (3,) inside or at a corner of a body that joints move, placed at q."""
    arm = run.task.arm
    model = World(arm, Scene()).geometry_model
    data = pin.GeometryData(model)
    pin.updateGeometryPlacements(arm.model, arm.model.createData(), model, data, q)
    moved = [k for k, item in enumerate(model.geometryObjects) if item.parentJoint > 0]
    k = int(rng.choice(moved))
    shape = model.geometryObjects[k].geometry
    points = np.array(shape.points()) if hasattr(shape, "points") else np.zeros((1, 3))
    point = points[rng.integers(len(points))] if corner else points.mean(axis=0)
    return np.asarray(data.oMg[k].act(point), np.float64)


def with_obstacle(run: Run, obstacle: Obstacle) -> Run:
    others = [item for item in run.task.scene if item.name != obstacle.name]
    return with_task(run, scene=Scene([*others, obstacle], run.task.scene.attachments))


def pinhead(point: Array, radius: float = 1e-4) -> Sphere:
    return Sphere(name="pinhead", radius=radius, position=tuple(point.tolist()))


def touches(run: Run, q: Array, name: str) -> bool:
    world = World(run.task.arm, run.task.scene)
    distance = world.distances(q)
    return any(gap <= 0.0 and name in pair for gap, pair in zip(distance, world.pairs, strict=True))


def obstacle_on_the_way(run: Run, rng: np.random.Generator) -> Run:
    point = inside_a_body(run, run.q[rng.integers(len(run.q))], rng)
    return with_obstacle(run, pinhead(point, abs(exponent(rng, -6, -2))))


def obstacle_moved(run: Run, rng: np.random.Generator) -> Run:
    movable = [item for item in run.task.scene if isinstance(item, Box | Cylinder | Sphere)]
    point = inside_a_body(run, run.q[rng.integers(len(run.q))], rng)
    obstacle = movable[rng.integers(len(movable))]
    return with_obstacle(run, replace(obstacle, position=tuple(point.tolist())))


def obstacle_enlarged(run: Run, rng: np.random.Generator) -> Run:
    """Grow an obstacle by a little more than the smallest distance that was kept to it."""
    movable = [item for item in run.task.scene if isinstance(item, Box | Cylinder | Sphere)]
    obstacle = movable[rng.integers(len(movable))]
    world = World(run.task.arm, run.task.scene)
    mine = [k for k, pair in enumerate(world.pairs) if obstacle.name in pair]
    by = min(world.distances(q)[mine].min() for q in run.q[:: max(1, len(run.q) // 100)])
    by += abs(exponent(rng, -6, -2))
    grown: Obstacle
    if isinstance(obstacle, Box):
        grown = replace(obstacle, size=tuple(side + 2.0 * by for side in obstacle.size))
    elif isinstance(obstacle, Cylinder):
        length = obstacle.length + 2.0 * by
        grown = replace(obstacle, radius=obstacle.radius + by, length=length)
    else:
        grown = replace(obstacle, radius=obstacle.radius + by)
    return with_obstacle(run, grown)


def obstacle_between_samples(run: Run, rng: np.random.Generator) -> Run:
    """A pinhead that the arm passes through between two samples and touches at none."""
    every = int(rng.integers(50, 200))
    rows = np.r_[0 : len(run.q) - 1 : every, len(run.q) - 1]
    dt = every * run.task.simulation.dt
    few = with_task(run, simulation=replace(run.task.simulation, dt=dt))
    few = regridded(few, rows)
    arm, k = run.task.arm, int(rng.integers(len(rows) - 1))
    middle = arm.integrate(few.q[k], 0.5 * arm.difference(few.q[k], few.q[k + 1]))
    blocked = with_obstacle(few, pinhead(inside_a_body(run, middle, rng)))
    if any(touches(blocked, q, "pinhead") for q in few.q):
        raise NotPossibleError
    return blocked


def blocked_stop(run: Run, rng: np.random.Generator) -> Run:
    """A pinhead where stopping would end, which the run itself passes by."""
    arm, world = run.task.arm, World(run.task.arm, run.task.scene)
    every = max(1, len(run.q) // 50)
    stops = StoppingCheck(world, StoppingTrajectory(arm)).check(run.q[::every], run.v[::every])
    k = int(rng.choice(np.argsort(stops.duration)[-len(stops.duration) // 2 :]))
    point = inside_a_body(run, arm.configuration(stops.end[k]), rng, corner=True)
    blocked = with_obstacle(run, pinhead(point))
    if any(touches(blocked, q, "pinhead") for q in run.q[:: max(1, every // 5)]):
        raise NotPossibleError
    return blocked
