"""Problems: from a start to a goal in a scene, one by one or in processes, and their results."""

import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.task import PLANTS
from densarm.errors import FileContentError, InvalidValueError
from densarm.scenarios.control import ControlParameters
from densarm.scenarios.run import run as run_scenario
from densarm.scenarios.scenario import Scenario
from densarm.scene.loading import MotionProblem
from densarm.simulation.disturbances import Disturbances
from densarm.simulation.run import Run
from densarm.study.cluster import in_order
from densarm.study.measures import motion_time, path_length, shortest_time
from densarm.values.checks import one_of
from densarm.values.outcome import FAILED, RUN_ENDS, Outcome
from densarm.values.progress import OnProgress
from densarm.values.tables import parse_table

PERCENTILES = (50, 95, 98)

GOALS = ("configuration", "pose")
"""What of a problem's goal is asked for: all of it, or where the end effector is there."""

MEASURES = (
    "plan_time_s",
    "preparation_time_s",
    "duration_s",
    "motion_s",
    "optimal_ratio",
    "path_length_rad",
)
"""What percentiles are taken of, as `ProblemResult` calls it."""


@dataclass(frozen=True)
class ProblemResult:
    """How one problem's run ended."""

    scene: str
    """The set that the problem belongs to."""
    index: int
    """Its place in the set."""
    outcome: str
    """One of `RUN_ENDS`."""
    detail: str = ""
    """What stood in the way, as a phrase."""
    duration_s: float | None = None
    """Simulated time [s]; None where nothing ran, as in what follows."""
    min_clearance_m: float | None = None
    """Smallest signed distance [m]; None without pairs."""
    goal_error_rad: float | None = None
    """Largest joint error at the end [rad or m]."""
    peak_torque_ratio: float | None = None
    """Largest torque in units of its limit."""
    plan_time_s: float | None = None
    """Wall-clock time that the guide took [s]."""
    preparation_time_s: float | None = None
    """Wall-clock time from the scenario to the first torque [s], where the record tells it."""
    motion_s: float | None = None
    """Simulated time from which on the arm was at the goal and at rest [s]."""
    optimal_s: float | None = None
    """Shortest time along the same path under the same limits [s], where that was asked for."""
    path_length_rad: float | None = None
    """Length of the way in joint space [rad or m]."""
    certified: bool = False
    """Whether the certificate holds in every part."""
    led_by: str = ""
    """What found the way, as a phrase."""
    tube_rad: Sequence[float] | None = None
    """Bounds on the tracking error of each joint under which the motion stays proved clear
    [rad or m]; None without a motion."""
    plant: str = PLANTS[0]
    """What was driven."""
    disturbances: Mapping[str, Any] = field(default_factory=dict)
    """How it differed from the arm's model."""

    @property
    def optimal_ratio(self) -> float | None:
        """Time of the motion in units of the shortest along the same path."""
        if self.motion_s is None or self.optimal_s is None:
            return None
        return self.motion_s / self.optimal_s


@dataclass(frozen=True)
class ProblemResults:
    """How the runs of a set of problems ended."""

    results: tuple[ProblemResult, ...]

    @property
    def total(self) -> int:
        """Number of problems."""
        return len(self.results)

    @property
    def certified(self) -> int:
        """Number of runs that reached the goal and whose certificate holds in every part."""
        return sum(r.outcome == Outcome.REACHED and r.certified for r in self.results)

    @property
    def min_clearance(self) -> float | None:
        """Smallest signed distance of all runs [m]; None without pairs."""
        found = [r.min_clearance_m for r in self.results if r.min_clearance_m is not None]
        return min(found, default=None)

    @property
    def sets(self) -> tuple[str, ...]:
        """Names of the sets that the problems belong to."""
        return tuple(dict.fromkeys(result.scene for result in self.results))

    def of(self, scene: str | None) -> "ProblemResults":
        """Return the results of one set of problems; of all without a name."""
        return ProblemResults(tuple(r for r in self.results if scene in (None, r.scene)))

    def count(self, outcome: str) -> int:
        """Return the number of runs that ended so."""
        return sum(r.outcome == outcome for r in self.results)

    @property
    def led_by(self) -> dict[str, int]:
        """Number of runs that reached the goal, by what found their way."""
        return dict(Counter(r.led_by for r in self.results if r.outcome == Outcome.REACHED))

    def percentiles(self, measure: str) -> list[float] | None:
        """Return the `PERCENTILES` of one of `MEASURES` over the runs that reached, where known."""
        reached = [getattr(r, measure) for r in self.results if r.outcome == Outcome.REACHED]
        known = [value for value in reached if value is not None]
        return np.percentile(known, PERCENTILES).tolist() if known else None

    def to_json(self) -> dict[str, Any]:
        """Return JSON data: every problem, the figures of all, and those of each set."""
        return {
            "problems": [vars(result) for result in self.results],
            **self.figures(),
            "sets": {name: self.of(name).figures() for name in self.sets},
        }

    def figures(self) -> dict[str, Any]:
        """Return counts, and the `PERCENTILES` of each measure, as JSON data."""
        return {
            "reached": self.count(Outcome.REACHED),
            "certified": self.certified,
            "total": self.total,
            "led_by": self.led_by,
            "outcomes": {outcome: self.count(outcome) for outcome in RUN_ENDS},
            **{measure: self.percentiles(measure) for measure in MEASURES},
            "min_clearance_m": self.min_clearance,
        }


def run_problems(
    problems: Sequence[MotionProblem],
    jobs: int = 1,
    on_progress: OnProgress = lambda _: None,
    scheduler: str | None = None,
    **options: Any,
) -> ProblemResults:
    """Plan each problem, run its torque-driven closed loop and prove it.

    Args:
        problems: what to run.
        jobs: processes on this machine; 1 for this one.
        on_progress: told what is being done.
        scheduler: address of a Dask scheduler whose workers run them, in place of processes here.
        options: those of `run_problem`.

    Returns:
        How each run ended, in the order of the problems, whatever the number of processes. A run
        that raises an error counts as failed and stops no other.

    Raises:
        UnknownNameError: a problem of no known robot, or of a joint to lock that it does not have.
        InvalidValueError: a problem that does not give each joint of the robot one position.
        DensarmError: what `as_completed` raises.
    """
    limits: dict[str, Any] = {key: options.get(key) for key in ("acceleration", "jerk")}
    for problem in problems:
        scenario_of(problem, **limits)

    def tell(count: int) -> None:
        on_progress(f"{count} of {len(problems)} problems run")

    work = partial(run_problem, **options)
    return ProblemResults(tuple(in_order(work, problems, jobs, scheduler, tell)))


def run_problem(
    problem: MotionProblem,
    seed: int = 0,
    guide: str = "auto",
    save_dir: Path | None = None,
    time_optimal: bool = False,
    plant: str = PLANTS[0],
    disturb: Mapping[str, Any] = MappingProxyType({}),
    draw: Mapping[str, float] = MappingProxyType({}),
    goals: str = GOALS[0],
    acceleration: float | None = None,
    jerk: float | None = None,
) -> ProblemResult:
    """Plan a problem, run its closed loop and prove it; an error becomes a result.

    Args:
        problem: of a known robot.
        seed: of the planner.
        guide: what supplies the sub-goals: one of `GUIDES`.
        save_dir: folder of the recorded runs, SCENE_INDEX.npz; a problem whose record is there
            already is not run again. None to keep none.
        time_optimal: whether to compute the shortest time along the run's path.
        plant: what is driven, "pinocchio" or "mujoco".
        disturb: how it differs from the model, as the keys of a table ``[disturbances]``.
        draw: what of this is drawn, as `drawn` does it.
        goals: one of `GOALS`.
        acceleration: limit of every joint, as `scenario_of`.
        jerk: the same.
    """

    def run() -> Run:
        scenario = scenario_of(problem, seed, goals, acceleration=acceleration, jerk=jerk)
        told = {**disturb, **drawn(draw, problem, seed, scenario.arm.nv)}
        scenario = replace(
            scenario,
            control=ControlParameters(guide=guide),
            plant=plant,
            disturbances=parse_table("disturbances", Disturbances, told),
        )
        if save_dir is None:
            return run_scenario(scenario)
        file = save_dir / f"{problem.scene_name}_{problem.index}.npz"
        if not file.is_file():
            done = run_scenario(scenario)
            done.save(file)
            return done
        recorded = Run.load(file)
        reached = recorded.task.goal if scenario.goals else scenario.goal
        if recorded.task.to_json() != replace(scenario.task, goal=reached).to_json():
            raise FileContentError(file, "the record of another problem: remove it, or its folder")
        return recorded

    return problem_result(problem.scene_name, problem.index, run, time_optimal)


def drawn(
    sizes: Mapping[str, float], problem: MotionProblem, seed: int, nv: int
) -> dict[str, list[float]]:
    """Return disturbances, one number per joint (nv,), each drawn for itself.

    Args:
        sizes: names of disturbances: ``mass_scale`` is drawn evenly from 1 - size to 1 + size, any
            other from 0 to its size.
        problem: for which they are drawn, always the same for the same seed.
        seed: of all problems.
        nv: number of joints.
    """
    which = zlib.crc32(f"{problem.scene_name} {problem.index}".encode())
    random, told = np.random.default_rng([seed, which]), {}
    for name, size in sizes.items():
        least = 1.0 - size if name == "mass_scale" else 0.0
        told[name] = random.uniform(least, 1.0 + size if least else size, nv).tolist()
    return told


def problem_result(
    scene: str, index: int, run: Callable[[], Run], time_optimal: bool = False
) -> ProblemResult:
    """Return how a run ends, given by a function that runs it; an error becomes a result."""
    try:
        done = run()
        reached = done.outcome == Outcome.REACHED
        return ProblemResult(
            scene=scene,
            index=index,
            detail=done.detail,
            motion_s=motion_time(done) if reached else None,
            optimal_s=shortest_time(done) if reached and time_optimal else None,
            path_length_rad=path_length(done),
            **done.summary(),
        )
    except (ValueError, ArithmeticError, RuntimeError) as error:
        return ProblemResult(scene, index, FAILED, str(error))


def scenario_of(
    problem: MotionProblem,
    seed: int = 0,
    goals: str = GOALS[0],
    *,
    acceleration: float | None = None,
    jerk: float | None = None,
) -> Scenario:
    """Return a problem of a known robot as a scenario with default parameters.

    Args:
        problem: of a known robot.
        seed: of the planner.
        goals: one of `GOALS`: the problem's goal, or the end effector's pose there.
        acceleration: limit of every joint [rad/s² or m/s²]; None for the robot's own.
        jerk: the same [rad/s³ or m/s³].

    Raises:
        UnknownNameError: no such robot, or joint to lock.
        InvalidValueError: it does not give each joint of the robot one position, or a limit that
            is not positive.
    """
    locked = tuple(sorted(problem.locked_joints.items()))
    arm = named_arm(problem.robot, locked, acceleration, jerk)
    if sorted(problem.joints) != sorted(arm.joint_names):
        allowed = f"the joints of {problem.robot}, {', '.join(arm.joint_names)}"
        raise InvalidValueError("metadata.joints", list(problem.joints), allowed)
    order = [problem.joints.index(name) for name in arm.joint_names]
    name = f"{problem.robot}_{problem.scene_name}_{problem.index}"
    goal = arm.configuration([problem.goal[k] for k in order])
    wanted: Any = goal if one_of("goals", goals, GOALS) == GOALS[0] else arm.pose(goal)
    return Scenario(
        name=name,
        title=name,
        arm=arm,
        scene=problem.scene,
        start=arm.configuration([problem.start[k] for k in order]),
        goal=wanted,
        seed=seed,
    )


@lru_cache(maxsize=1)
def named_arm(
    name: str,
    locked_joints: tuple[tuple[str, float], ...] = (),
    acceleration: float | None = None,
    jerk: float | None = None,
) -> Arm:
    """Return an arm as `load_arm` does, the same one when it is asked for again.

    Where it is given, all joints have one limit of acceleration, or of jerk.
    """
    arm = load_arm(name, locked_joints=dict(locked_joints), jerk=jerk)
    if acceleration is None:
        return arm
    return Arm(replace(arm.description, acceleration=(acceleration,) * arm.nv))
