"""Ways to put something in the way of a run."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from densarm import Box, Clearance, Cylinder, Scene, Sphere
from densarm.proof.stopping_check import StoppingCheck
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound
from tampering.kind import NotPossibleError, exponent, regridded, with_scenario


def inside_a_body(run, q, rng, corner=False):
    """Return a point (3,) inside or at a corner of a body that joints move, placed at q."""
    clearance = Clearance(run.scenario.arm, Scene([]))
    model, data = clearance.geometry_model, pin.GeometryData(clearance.geometry_model)
    arm = run.scenario.arm
    pin.updateGeometryPlacements(arm.model, arm.model.createData(), model, data, q)
    moved = [k for k, item in enumerate(model.geometryObjects) if item.parentJoint > 0]
    k = int(rng.choice(moved))
    shape = model.geometryObjects[k].geometry
    points = np.array(shape.points()) if hasattr(shape, "points") else np.zeros((1, 3))
    point = points[rng.integers(len(points))] if corner else points.mean(axis=0)
    return data.oMg[k].act(point)


def with_obstacle(run, obstacle):
    others = [item for item in run.scenario.scene if item.name != obstacle.name]
    return with_scenario(run, scene=Scene([*others, obstacle], run.scenario.scene.attachments))


def pinhead(point, radius=1e-4):
    return Sphere(name="pinhead", radius=radius, position=tuple(point.tolist()))


def touches(run, q, name):
    clearance = Clearance(run.scenario.arm, run.scenario.scene)
    distance = clearance.distances(q)
    return any(
        gap <= 0.0 and name in pair for gap, pair in zip(distance, clearance.pairs, strict=True)
    )


def obstacle_on_the_way(run, rng):
    point = inside_a_body(run, run.q[rng.integers(len(run.q))], rng)
    return with_obstacle(run, pinhead(point, abs(exponent(rng, -6, -2))))


def obstacle_moved(run, rng):
    movable = [item for item in run.scenario.scene if isinstance(item, Box | Cylinder | Sphere)]
    point = inside_a_body(run, run.q[rng.integers(len(run.q))], rng)
    obstacle = movable[rng.integers(len(movable))]
    return with_obstacle(run, replace(obstacle, position=tuple(point.tolist())))


def obstacle_enlarged(run, rng):
    """Grow an obstacle by a little more than the smallest distance that was kept to it."""
    movable = [item for item in run.scenario.scene if isinstance(item, Box | Cylinder | Sphere)]
    obstacle = movable[rng.integers(len(movable))]
    clearance = Clearance(run.scenario.arm, run.scenario.scene)
    mine = [k for k, pair in enumerate(clearance.pairs) if obstacle.name in pair]
    by = min(clearance.distances(q)[mine].min() for q in run.q[:: max(1, len(run.q) // 100)])
    by += abs(exponent(rng, -6, -2))
    if isinstance(obstacle, Box):
        grown = {"size": tuple(side + 2.0 * by for side in obstacle.size)}
    else:
        grown = {"radius": obstacle.radius + by}
        if isinstance(obstacle, Cylinder):
            grown["length"] = obstacle.length + 2.0 * by
    return with_obstacle(run, replace(obstacle, **grown))


def obstacle_between_samples(run, rng):
    """A pinhead that the arm passes through between two samples and touches at none."""
    every = int(rng.integers(50, 200))
    rows = np.r_[0 : len(run.q) - 1 : every, len(run.q) - 1]
    dt = every * run.scenario.simulation.dt
    few = with_scenario(run, simulation=replace(run.scenario.simulation, dt=dt))
    few = regridded(few, rows)
    arm, k = run.scenario.arm, int(rng.integers(len(rows) - 1))
    middle = arm.integrate(few.q[k], 0.5 * arm.difference(few.q[k], few.q[k + 1]))
    blocked = with_obstacle(few, pinhead(inside_a_body(run, middle, rng)))
    if any(touches(blocked, q, "pinhead") for q in few.q):
        raise NotPossibleError
    return blocked


def blocked_brake(run, rng):
    """A pinhead where a brake would end, which the run itself passes by."""
    arm, bound = run.scenario.arm, SweptBound(Clearance(run.scenario.arm, run.scenario.scene))
    every = max(1, len(run.q) // 50)
    stops = StoppingCheck(bound, StraightBrake(arm)).check(run.q[::every], run.v[::every])
    k = int(rng.choice(np.argsort(stops.duration)[-len(stops.duration) // 2 :]))
    point = inside_a_body(run, arm.configuration(stops.end[k]), rng, corner=True)
    blocked = with_obstacle(run, pinhead(point))
    if any(touches(blocked, q, "pinhead") for q in run.q[:: max(1, every // 5)]):
        raise NotPossibleError
    return blocked
