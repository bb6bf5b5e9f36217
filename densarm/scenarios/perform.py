"""Steps one after another: each planned from where the last ended, in a world as that left it."""

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.arms.joints import with_moving, without_mimics
from densarm.arms.line import Line
from densarm.arms.models import frame_index
from densarm.certificates.phases import LINE, UPRIGHT, WAY_POINTS, body_poses, positions_of
from densarm.certificates.task import Task
from densarm.control.tracking import DensityTracking
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import DensityParameters
from densarm.density.sub_goals import GuidePath
from densarm.errors import InvalidValueError
from densarm.planning.goals import Goal, candidates, goal_list
from densarm.planning.motion import Motion, PlanningError
from densarm.planning.plan import plan_motion
from densarm.planning.straight import straight_way
from densarm.scenarios.scenario import Scenario
from densarm.scenarios.steps import (
    Attach,
    Detach,
    Grip,
    MoveTo,
    Step,
    Wait,
    gripper_positions,
    require_step,
    touching,
)
from densarm.scene.obstacles import Obstacle, obstacle_pose, pose_fields
from densarm.scene.scene import Attachment, Scene
from densarm.simulation.disturbances import Disturbances
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate_task
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.values.progress import OnProgress
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

_IN_HAND, _ON_SUPPORT = 0.01, 1e-3  # [m] that a body is from what takes it, or what it is put on
_HOLD = 0.15  # [s] that the end of a phase is held, in which tracking errors fade


def run_steps(
    world: World,
    start: ArrayLike,
    steps: Sequence[object],
    *,
    title: str = "steps",
    plant: str = "pinocchio",
    disturbances: Disturbances = Disturbances(),
    on_progress: OnProgress = lambda _: None,
) -> Run:
    """Do steps one after another: plan each from where the last ended, run and record it.

    Args:
        world: the arm among obstacles, none of which moves; it stays as it is.
        start: configuration (nq,).
        steps: what is done: `MoveTo`, `Line`, `Grip`, `Attach`, `Detach` and `Wait`.
        title: of the record.
        plant: "pinocchio" or "mujoco", in which the arm has what it holds for a part as well.
        disturbances: how the arm differs from its model, not the gripper.
        on_progress: told what is being done.

    Returns:
        The recorded run, its `phases` the steps that take time. It ends with the first that
        fails, whose reason is its `detail`.

    Raises:
        DensarmError: steps that cannot follow one another, or bad input as for `plan_motion`.
    """
    start = world.arm.check_configuration("start", start)
    if not len(steps):
        raise InvalidValueError("steps", [], "at least one")
    scenario = Scenario(
        name="steps",
        title=title,
        arm=world.arm,
        scene=world.scene,
        start=start,
        goal=start,
        steps=[require_step(f"steps[{k}]", step) for k, step in enumerate(steps)],
        plant=plant,
        disturbances=disturbances,
    )
    return perform(scenario, on_progress)


def perform(scenario: Scenario, on_progress: OnProgress = lambda _: None) -> Run:
    """Do the steps of a scenario, as `run_steps`."""
    cell, phases, steps = _Cell(scenario, on_progress), list[Run](), scenario.steps
    for k, step in enumerate(steps):
        on_progress(f"step {k + 1} of {len(steps)}, {step}")
        if isinstance(step, Attach):
            phases += cell.attach(step)
        elif isinstance(step, Detach):
            phases += cell.detach(step)
        else:
            phases.append(cell.phase(k))
        if phases and phases[-1].outcome != Outcome.REACHED:
            break
    last = phases[-1]
    remarks = (f"{run.task.title}: {run.remark}" for run in phases if run.remark)
    ended: dict[str, Any] = {"outcome": last.outcome, "remark": "; ".join(remarks)}
    if last.outcome != Outcome.REACHED:
        ended["detail"] = f"step {k + 1} of {len(steps)}, {last.task.title}: {last.detail}"
    return Run.of_phases(cell.whole_task, phases, **ended)


class _Cell:
    """Robot and bodies as the steps that were done left them."""

    def __init__(self, scenario: Scenario, on_progress: OnProgress) -> None:
        arm, steps = scenario.arm, scenario.steps
        self._scenario, self._on_progress = scenario, on_progress
        grips = [gripper_positions(arm.description, x) for x in steps if isinstance(x, Grip)]
        joints = sorted({name for grip in grips for name in grip})
        self._obstacles = {item.name: item for item in scenario.scene}
        self._arm = Arm(without_mimics(arm.description)) if joints else arm
        self._q: Array = scenario.start
        self._v = np.zeros(arm.nv)
        own = replace(self._arm.description, attachments=())
        whole = Arm(with_moving(own, joints, {})) if joints else Arm(own)
        bodies = body_poses(scenario.task, self._q).values()
        angles = positions_of(self._arm, self._q[np.newaxis], whole.joint_names)[0]
        self.whole_task = replace(
            scenario.task,
            arm=whole,
            scene=Scene(_placed(body, pose) for body, pose in bodies),
            start=whole.configuration(angles),
            goal=None,
            settings={},
        )
        """The arm with the joints of its gripper and without what it holds, all bodies at first."""

    def attach(self, step: Attach) -> list[Run]:
        """Make an obstacle a part of the arm, where it is; return the run of nothing if not."""
        model, body = self._arm.model, self._obstacles[step.body]
        joint = model.frames[frame_index(model, step.link)].parentJoint
        shapes = self._arm.collision_model.geometryObjects
        hand = {shape.name for shape in shapes if shape.parentJoint == joint}
        if fault := self._apart(step, hand, step.body, _IN_HAND, f"what moves with {step.link!r}"):
            return fault
        del self._obstacles[step.body]
        local = self._arm.pose(self._q, step.link).placement.inverse() * obstacle_pose(body)
        held = Attachment(_placed(body, local), step.link, mass=step.mass)
        self._hold([*self._arm.description.attachments, held])
        return self._off_support(step)

    def detach(self, step: Detach) -> list[Run]:
        """Make a held body an obstacle, where it is; return the run of nothing if not."""
        if fault := self._off_support(step):
            return fault
        held = self._arm.description.attachments
        (kept,) = (each for each in held if each.body.name == step.body)
        pose = self._arm.pose(self._q, kept.link).placement * obstacle_pose(kept.body)
        self._obstacles[step.body] = _placed(kept.body, pose)
        self._hold([each for each in held if each is not kept])
        return []

    def _off_support(self, step: Attach | Detach) -> list[Run]:
        if step.support is None:
            return []
        return self._apart(step, {step.body}, step.support, _ON_SUPPORT, repr(step.body))

    def _apart(
        self, step: Attach | Detach, shapes: set[str], other: str, most: float, what: str
    ) -> list[Run]:
        """Return the run of nothing where shapes are farther from an obstacle than a length [m]."""
        world, near = World(self._arm, Scene(self._obstacles.values())), np.inf
        for distance, pair in zip(world.distances(self._q), world.pairs, strict=True):
            of = [{shape, shape.rpartition(".")[0]} for shape in pair]  # itself, or a part
            if of[0] & shapes and other in of[1]:
                near = min(near, float(distance))
        if near <= most:
            return []
        task = self._task(step, world, self._q)
        far = f"{1e3 * near:.3g} mm away from {what}, and may be {1e3 * most:g} mm at most"
        return [Run.at_rest(task, world, Outcome.INFEASIBLE, f"{other!r} is {far}")]

    def phase(self, k: int) -> Run:
        """Do a step that takes time, by its number."""
        step, began = self._scenario.steps[k], time.perf_counter()
        arm, start = self._arm_in(k), self._q
        if isinstance(step, Grip):
            arm = self._gripper(step)
            start = arm.configurations(positions_of(self._arm, start[np.newaxis], arm.joint_names))[
                0
            ]
        world = World(arm, Scene(self._obstacles.values()))
        task = self._task(step, world, start)
        try:
            motion, passed_over = self._motion(k, world, start)
        except PlanningError as error:
            return Run.at_rest(task, world, error.outcome, error.detail)
        law = self._scenario.law_options | {"density": task.density}
        distance = TorusDistance(arm, kappa=task.kappa)
        controller = DensityTracking(world, motion, goal_distance=distance, **law)
        prepared = time.perf_counter() - began
        told = Disturbances() if isinstance(step, Grip) else self._scenario.disturbances
        task = replace(task, goal=motion.goal, settings={**task.settings, **_said(arm, motion)})
        done = simulate_task(task, world, controller, None, told, self._on_progress)
        self._leave(done)
        path = motion.path or GuidePath(motion.position, is_clear=True)
        remark = "; ".join(filter(None, [passed_over, path.remark, done.remark]))
        found: dict[str, Any] = {"led_by": path.found_by, "stuck": path.stuck, "remark": remark}
        return replace(done, plan_time=motion.plan_time, preparation_time=prepared, **found)

    def _motion(self, k: int, world: World, start: Array) -> tuple[Motion, str]:
        """Return the motion of a step, and what was tried before in vain, as a phrase."""
        scenario, step, passed_over = self._scenario, self._scenario.steps[k], ""
        period = scenario.simulation.control_period
        goal: Goal | Line = start
        if isinstance(step, Wait):
            rest = np.tile(world.arm.angles(start), (2, 1))
            return Motion(period, rest, np.zeros_like(rest), goal=start, world=world), ""
        options = scenario.plan_options
        if isinstance(step, Line):
            goal = step
        elif isinstance(step, MoveTo):
            goal, passed_over = self._goals(k, world, step.goal)
            own = ("through", "blend", "upright", "tilt")
            options |= {key: getattr(step, key) for key in own}
        elif isinstance(step, Grip):
            positions = gripper_positions(scenario.arm.description, step)
            goal = world.arm.configuration([positions[name] for name in world.arm.joint_names])
            options |= {"density": DensityParameters()}
        limit = scenario.simulation.time_limit
        timed: dict[str, Any] = {"period": period, "timing": scenario.timing, "time_limit": limit}
        try:
            return plan_motion(world, start, goal, **options, **timed), passed_over
        except PlanningError as error:
            also = f"; {passed_over}" if passed_over else ""
            raise PlanningError(error.outcome, error.detail + also) from None

    def _goals(self, k: int, world: World, goal: Goal) -> tuple[Goal, str]:
        """Return goals from which the lines that follow a step can be gone, and what others met."""
        lines, scenario = list(self._lines_after(k)), self._scenario
        if not lines:
            return goal, ""
        check, faults = SweptCheck(world, scenario.control.margin), dict[int, str]()
        ways, clear = list[tuple[float, int, Array]](), list[Array]()
        asked = scenario.seed, scenario.planning.solutions, scenario.control.path_margin
        for n, given in enumerate(goal_list(world.arm, goal), start=1):
            try:
                found = candidates(check, self._q, [given], *asked)
            except PlanningError as error:
                faults[n] = error.detail
            else:
                ways += [(way.least_cost, n, way.q) for way in found]
        for _, n, q in sorted(ways, key=lambda way: way[0]):
            if len(clear) == scenario.planning.goals:
                break
            if fault := _fault_on(q, lines):
                faults.setdefault(n, fault)
            else:
                clear.append(q)
        tried = "; ".join(f"goal {n}: {fault}" for n, fault in faults.items())
        if not clear:
            raise PlanningError(Outcome.NO_PATH, f"none leads on of {len(ways)} ways to {tried}")
        return clear, f"passed over ways to {tried}" if tried else ""

    def _lines_after(self, k: int) -> Iterator[tuple[Line, SweptCheck]]:
        """Yield the lines right after a step, each with what it must be clear of."""
        scene, margin = Scene(self._obstacles.values()), self._scenario.control.margin
        for n, step in enumerate(self._scenario.steps[k + 1 :], start=k + 1):
            if not isinstance(step, Line):
                return
            yield step, SweptCheck(World(self._arm_in(n), scene), margin)

    def _task(self, step: Step, world: World, start: Array) -> Task:
        """Return what a step's run is about, its goal to come."""
        simulation = self._scenario.simulation
        hold = step.seconds if isinstance(step, Wait) else max(simulation.hold_time, _HOLD)
        limit = max(simulation.time_limit, 2.0 * hold)
        changes: dict[str, Any] = {
            "arm": world.arm,
            "scene": world.scene,
            "start": start,
            "goal": None,
            "start_velocity": None if isinstance(step, Grip) else self._v,
            "title": str(step),
            "simulation": replace(simulation, hold_time=hold, time_limit=limit),
        }
        if isinstance(step, Line):
            line = step.segment(world.arm, start).to_json()
            changes["settings"] = {**self._scenario.task.settings, LINE: line}
        if isinstance(step, Grip):
            changes["density"] = DensityParameters()
        return replace(self._scenario.task, **changes)

    def _arm_in(self, k: int) -> Arm:
        """Return the arm in a step, in which what it holds may touch its support."""
        supports, arm = touching(self._scenario.steps, k), self._arm
        held = arm.description.attachments
        free = [x for x in held if x.body.name in supports]
        if not isinstance(self._scenario.steps[k], Line) or not free:
            return arm
        touched = tuple(
            replace(x, touch_obstacles=(supports[x.body.name],)) if x in free else x for x in held
        )
        return Arm(replace(arm.description, attachments=touched))

    def _gripper(self, step: Grip) -> Arm:
        """Return the joints of a gripper as an arm, the others at rest."""
        arm = self._arm
        standing = dict(zip(arm.joint_names, arm.angles(self._q).tolist(), strict=True))
        joints = gripper_positions(self._scenario.arm.description, step)
        return Arm(with_moving(arm.description, joints, standing))

    def _hold(self, held: Sequence[Attachment]) -> None:
        self._arm = Arm(replace(self._arm.description, attachments=tuple(held)))

    def _leave(self, run: Run) -> None:
        """Go on from where a run of the arm, or of its gripper, ended."""
        arm, q = run.task.arm, run.q[-1]
        if arm.joint_names == self._arm.joint_names:
            self._q, self._v = q, run.v[-1]
            return
        moved = dict(zip(arm.joint_names, arm.angles(q).tolist(), strict=True))
        own = self._arm.description
        self._arm = Arm(replace(own, locked_joints={**own.locked_joints, **moved}))
        self._v = np.zeros(self._arm.nv)


def _fault_on(q: Array, lines: Iterable[tuple[Line, SweptCheck]]) -> str:
    """Return why lines cannot be gone from a configuration (nq,), as a phrase, or nothing."""
    try:
        for line, check in lines:
            q = straight_way(check, q, line)[0].waypoints[-1]
    except PlanningError as error:
        return error.detail
    return ""


def _said(arm: Arm, motion: Motion) -> dict[str, Any]:
    """Return what a phase says of its motion beside its goal."""
    said = dict[str, Any]()
    if (passed := motion.way_points) is not None:
        said[WAY_POINTS] = {"positions": arm.angles(passed.q).tolist(), "blend": passed.blend}
    if motion.upright is not None:
        said[UPRIGHT] = motion.upright.to_json()
    return said


def _placed(body: Obstacle, pose: pin.SE3) -> Obstacle:
    """Return a body at a pose."""
    return replace(body, **pose_fields(pose))
