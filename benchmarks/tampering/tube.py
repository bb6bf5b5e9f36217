"""Ways to promise more of a run's tube than is true."""

from dataclasses import replace

import numpy as np

from densarm import Run, World
from densarm.values.arrays import Array
from densarm.world.stopping import StoppingTrajectory
from tampering.file import reloaded
from tampering.kind import NotPossibleError, exponent
from tampering.obstruction import inside_a_body, pinhead, touches, with_obstacle

_WIDEST = 300.0  # times the tube, at which something is looked for that it touches


def known(run: Run) -> tuple[Array, Array]:
    if run.reference is None or run.tube is None:
        raise NotPossibleError
    return run.reference, run.tube


def off_reference(run: Run, k: int, off: Array) -> Array:
    reference, _ = known(run)
    return run.task.arm.configuration(reference[k] + off)


def widened_towards(run: Run, rng: np.random.Generator, direction: Array) -> Run:
    """Widen the tube until some configuration in it, off the reference that way, touches."""
    reference, tube = known(run)
    world, k = World(run.task.arm, run.task.scene), int(rng.integers(len(reference)))
    low, high = 1.0, 0.0
    for factor in np.geomspace(1.0, _WIDEST, 24):
        if (world.distances(off_reference(run, k, factor * direction * tube)) <= 0.0).any():
            high = float(factor)
            break
        low = float(factor)
    if high == 0.0:
        raise NotPossibleError
    for _ in range(12):
        middle = 0.5 * (low + high)
        touching = world.distances(off_reference(run, k, middle * direction * tube)) <= 0.0
        low, high = (low, middle) if touching.any() else (middle, high)
    widened = np.where(direction != 0.0, np.maximum(high * np.abs(direction), 1.0) * tube, tube)
    return replace(run, tube=widened)


def widened(run: Run, rng: np.random.Generator) -> Run:
    _, tube = known(run)
    return widened_towards(run, rng, rng.uniform(0.3, 1.0, tube.size) * rng.choice([-1.0, 1.0]))


def joint_widened(run: Run, rng: np.random.Generator) -> Run:
    _, tube = known(run)
    joint = int(rng.integers(tube.size))
    return widened_towards(run, rng, np.eye(tube.size)[joint] * rng.choice([-1.0, 1.0]))


def not_a_tube(run: Run, rng: np.random.Generator) -> Run:
    _, tube = known(run)
    tube = tube.copy()
    tube[rng.integers(tube.size)] = rng.choice([0.0, -1e-3, np.nan, -np.inf])
    return replace(run, tube=tube)


def obstacle_inside(run: Run, rng: np.random.Generator) -> Run:
    """A pinhead that the run passes by, where it might have been in its tube."""
    reference, tube = known(run)
    k, corner = int(rng.integers(len(reference))), rng.choice([-1.0, 1.0], tube.size)
    q = off_reference(run, k, rng.uniform(0.7, 1.0) * corner * tube)
    return unmet(run, inside_a_body(run, q, rng, corner=True))


def obstacle_at_stop(run: Run, rng: np.random.Generator) -> Run:
    """A pinhead that the run passes by, where it might have stopped in its tube."""
    reference, tube = known(run)
    arm, dt, k = run.task.arm, run.task.simulation.dt, int(rng.integers(len(reference) - 1))
    v = (reference[k + 1] - reference[k]) / dt
    duration = StoppingTrajectory(arm).duration(arm.configuration(reference[k]), v)
    way = 0.5 * duration * v + rng.choice([-1.0, 1.0], tube.size) * tube
    return unmet(run, inside_a_body(run, off_reference(run, k, way), rng, corner=True))


def unmet(run: Run, point: Array) -> Run:
    blocked = with_obstacle(run, pinhead(point))
    if any(touches(blocked, q, "pinhead") for q in run.q[:: max(1, len(run.q) // 100)]):
        raise NotPossibleError
    return blocked


def reference_shifted(run: Run, rng: np.random.Generator) -> Run:
    reference, tube = known(run)
    joint, reference = int(rng.integers(tube.size)), reference.copy()
    by = 2.0 * tube[joint] + abs(exponent(rng, -4, 0))
    reference[:, joint] += by * rng.choice([-1.0, 1.0])
    return replace(run, reference=reference)


def reference_bent(run: Run, rng: np.random.Generator) -> Run:
    reference, tube = known(run)
    joint, reference = int(rng.integers(tube.size)), reference.copy()
    by = 2.0 * tube[joint] + abs(exponent(rng, -4, 0))
    reference[rng.integers(len(reference)), joint] += by * rng.choice([-1.0, 1.0])
    return replace(run, reference=reference)


def reference_late(run: Run, rng: np.random.Generator) -> Run:
    reference, tube = known(run)
    late = int(rng.integers(5, 200))
    reference = np.vstack([np.tile(reference[0], (late, 1)), reference[:-late]])
    off = run.task.arm.difference(run.task.arm.configurations(reference), run.q)
    if not (np.abs(off) > 1.01 * tube).any():
        raise NotPossibleError
    return replace(run, reference=reference)


def run_astray(run: Run, rng: np.random.Generator) -> Run:
    """A sample outside the tube, of a plant that nothing replays."""
    _, tube = known(run)
    arm, q, k = run.task.arm, run.q.copy(), int(rng.integers(1, len(run.q) - 1))
    step, joint = np.zeros(tube.size), int(rng.integers(tube.size))
    step[joint] = rng.choice([-1.0, 1.0]) * (2.0 * tube[joint] + abs(exponent(rng, -5, -3)))
    q[k] = arm.integrate(q[k], step)
    return replace(run, q=q, task=replace(run.task, plant="mujoco"))


def damaged(run: Run, rng: np.random.Generator) -> Run:
    known(run)

    def change(arrays: dict[str, Array]) -> None:
        name = rng.choice(["reference", "tube"])
        if rng.random() < 0.5:
            arrays[name] = np.delete(arrays[name], rng.integers(len(arrays[name])), axis=0)
        else:
            arrays[name].flat[rng.integers(arrays[name].size)] = rng.choice([np.nan, np.inf])

    return reloaded(run, change)
