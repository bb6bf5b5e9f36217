"""An arm that swings among spheres, with as many geometry pairs as asked for."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.errors import InvalidValueError
from densarm.reference.reference import Reference
from densarm.scene import Scene, Sphere

_PERIOD = 0.001  # [s]
_DURATION = 2.0  # [s]
_AMPLITUDE = 0.3  # [rad or m]
_RADIUS = 0.05  # [m]
_NEAREST = 0.02  # distance from a sphere to the arm, at least [m]
_CANDIDATES = 50  # per sphere
_GROUP = 50  # candidates measured at once: making a Clearance takes the square of its pairs


def swing(arm: Arm) -> Reference:
    """Return a swing of every joint about zero, or as near to it as its limits allow."""
    limits = arm.limits
    middle = np.clip(0.0, limits.lower + _AMPLITUDE, limits.upper - _AMPLITUDE)
    t = np.arange(0.0, _DURATION + _PERIOD / 2.0, _PERIOD)[:, np.newaxis]
    rate = np.pi / _DURATION
    position = middle - _AMPLITUDE * np.cos(rate * t)
    return Reference(_PERIOD, position, _AMPLITUDE * rate * np.sin(rate * t) * np.ones(arm.nv))


def clearance_among_spheres(arm: Arm, reference: Reference, pairs: int) -> Clearance:
    """Return the clearance of an arm among spheres that it passes closely.

    Args:
        arm: the arm; it keeps no more of its self-collision pairs than are needed.
        reference: its motion, which touches no sphere.
        pairs: number of geometry pairs: arm to sphere, filled up by the arm's own.

    Raises:
        InvalidValueError: a number of pairs that the arm cannot have.
    """
    geometry = arm.collision_model
    moving = sum(item.parentJoint > 0 for item in geometry.geometryObjects)
    own = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    n_spheres, n_own = divmod(pairs, moving)
    if n_own > len(own):
        allowed = f"{moving} (the arm's moving shapes) times a number, plus at most {len(own)}"
        raise InvalidValueError("pairs", pairs, allowed)
    geometry.removeAllCollisionPairs()
    for pair in own[:n_own]:
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    return Clearance(arm, Scene(_spheres(arm, reference, n_spheres)))


def _spheres(arm: Arm, reference: Reference, count: int) -> list[Sphere]:
    """Return the spheres, out of many at random, that the moving arm passes closest."""
    random = np.random.default_rng(0)
    q = arm.configurations(reference.position[:: len(reference.position) // 10])
    data, geometry = arm.model.createData(), arm.collision_model
    geometry_data = geometry.createData()
    candidates = []
    for k in range(_CANDIDATES * count):
        pin.updateGeometryPlacements(arm.model, data, geometry, geometry_data, q[k % len(q)])
        body = geometry_data.oMg[int(random.integers(geometry.ngeoms))].translation
        direction = random.normal(size=3)
        offset = random.uniform(0.1, 0.4) * direction / np.linalg.norm(direction)
        candidates.append(
            Sphere(name=f"sphere_{k}", radius=_RADIUS, position=tuple((body + offset).tolist()))
        )
    groups = [candidates[k : k + _GROUP] for k in range(0, len(candidates), _GROUP)]
    passing = [_passing_distance(arm, group, q) for group in groups]
    distance = np.concatenate([np.zeros(0), *passing])
    clear = np.flatnonzero(distance >= _NEAREST)
    return [candidates[k] for k in clear[np.argsort(distance[clear])][:count]]


def _passing_distance(arm: Arm, spheres: list[Sphere], q: Array) -> Array:
    clearance = Clearance(arm, Scene(spheres))
    names = [pair[1] for pair in clearance.pairs]
    smallest = np.min([clearance.distances(row) for row in q], axis=0)
    return np.array([smallest[[name == s.name for name in names]].min() for s in spheres])
