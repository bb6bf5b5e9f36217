"""Comparison: every method from every start, under the same limits, margins, tuning and seeds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from densarm.arrays import Array
from densarm.clear_configurations import clear_configurations
from densarm.clearance import Clearance
from densarm.closed_loop import Drive, OnProgress, run_closed_loop
from densarm.errors import UnknownNameError
from densarm.fields.speed_law import SpeedParameters
from densarm.guides.guide import NoPath
from densarm.outcome import FAILED, RUN_ENDS, Outcome
from densarm.reference.timing_parameters import TimingParameters
from densarm.scenario import Scenario
from densarm.study.methods import MAIN_PARAMETERS, METHODS
from densarm.study.timed_controller import TimedController
from densarm.trajectory import Trajectory
from densarm.validation import non_negative_integer, positive_integer

LIMIT_SHARE = 0.9
"""Share of the velocity, acceleration and torque limits that every method plans with."""

SCALES = (1.0, 0.2, 5.0)
"""Multiples of the default of its main parameter that tuning tries on every method."""

_TUNING_SEED = 1_000_003  # added to the seed of the starts that are not tuned on
_ROOM = 0.005  # [m], that random starts keep beyond the margin


@dataclass(frozen=True)
class MethodRun:
    """One method from one start."""

    start: tuple[float, ...]
    """Joint positions [rad or m]."""
    outcome: str
    """One of `RUN_ENDS`."""
    detail: str
    """What stood in the way, in a phrase."""
    time_s: float | None = None
    """Simulated time to the end of the run [s]; None where it failed."""
    path_length_rad: float | None = None
    """Length of the way in joint space [rad]."""
    min_clearance_m: float | None = None
    """Smallest distance of any pair on the way [m]; None without pairs."""
    effort: float | None = None
    """∫ ‖τ‖² dt [N²m²s]."""
    plan_time_s: float | None = None
    """Wall-clock time that its guide took [s]; zero without one."""
    preparation_time_s: float | None = None
    """Wall-clock time before the first torque [s]."""
    step_us: float | None = None
    """Median wall-clock time of one call of the controller [µs]; None where it had none."""

    def to_json(self) -> dict[str, Any]:
        """Return JSON data."""
        return {**vars(self), "start": list(self.start)}


MEASURES = (
    "time_s",
    "path_length_rad",
    "min_clearance_m",
    "effort",
    "plan_time_s",
    "preparation_time_s",
    "step_us",
)
"""What is measured on a run, as `MethodRun` calls it."""


@dataclass(frozen=True)
class MethodResult:
    """One method from all starts."""

    method: str
    runs: tuple[MethodRun, ...]
    scale: float = 1.0
    """Of its main parameter, as tuning chose it."""

    @property
    def parameter(self) -> str:
        """Name of its main parameter."""
        return MAIN_PARAMETERS[self.method]

    def count(self, outcome: str) -> int:
        """Return the number of runs that ended so."""
        return sum(run.outcome == outcome for run in self.runs)

    def values(self, measure: str) -> list[float]:
        """Return a measure of the runs that reached the goal; step_us of all runs."""
        runs = [r for r in self.runs if measure == "step_us" or r.outcome == Outcome.REACHED]
        return [value for run in runs if (value := getattr(run, measure)) is not None]

    def median(self, measure: str) -> float | None:
        """Return the median of `values`, None without any."""
        values = self.values(measure)
        return float(np.median(values)) if values else None

    def to_json(self) -> dict[str, Any]:
        """Return JSON data."""
        return {
            "method": self.method,
            "parameter": self.parameter,
            "scale": self.scale,
            **{outcome: self.count(outcome) for outcome in RUN_ENDS},
            **{measure: self.median(measure) for measure in MEASURES},
            "runs": [run.to_json() for run in self.runs],
        }


@dataclass(frozen=True)
class Comparison:
    """All methods from all starts."""

    scenario: str
    seed: int
    methods: tuple[MethodResult, ...]
    tuning_starts: int
    """Number of other starts that the main parameters were tuned on."""

    @property
    def starts(self) -> int:
        """Number of starts."""
        return len(self.methods[0].runs)

    def to_json(self) -> dict[str, Any]:
        """Return JSON data; the measures of a method are medians."""
        return {
            "methods": [result.to_json() for result in self.methods],
            "starts": self.starts,
            "scenario": self.scenario,
            "seed": self.seed,
            "tuning_starts": self.tuning_starts,
            "limit_share": LIMIT_SHARE,
        }


def compare(
    scenario: Scenario,
    methods: Sequence[str] = tuple(METHODS),
    starts: int = 5,
    seed: int | None = None,
    tuning_starts: int = 3,
    on_progress: OnProgress = lambda _: None,
) -> Comparison:
    """Run methods from the same starts to the scenario's goal.

    All get the same arm, scene, margin, time step, time limit and gains, and plan with
    `LIMIT_SHARE` of the velocity, acceleration and torque limits; feedback may use them whole.
    Every method has one main parameter, `MAIN_PARAMETERS`, and all are tuned alike: of its default
    times each of `SCALES` the one that reaches from most tuning starts, then the one of the
    smallest median time, then the first. Tuning starts are drawn by another seed than the starts.

    Args:
        scenario: arm, scene, goal, limits and parameters; its own start comes first.
        methods: names of `METHODS`, at least one.
        starts: number of starts; all but the first are random and touch nothing.
        seed: of the starts and of the planner; None for the scenario's own.
        tuning_starts: number of starts to tune on; 0 keeps the defaults.
        on_progress: told what is being done.

    Returns:
        How each run ended. A run that raises an error counts as failed and stops no other.

    Raises:
        UnknownNameError: a method that there is not.
        InvalidValueError: a number of starts below one, of tuning starts below zero, or a seed that
            is not a whole number.
        DensarmError: no random start was found.
    """
    for name in methods:
        if name not in METHODS:
            raise UnknownNameError("method", name, METHODS)
    scenario = _with_equal_limits(scenario, seed)
    clearance, seed = Clearance(scenario.arm, scenario.scene), scenario.seed
    room = scenario.control.margin + _ROOM
    others = clear_configurations(clearance, positive_integer("starts", starts) - 1, seed, room)
    tuning = clear_configurations(
        clearance,
        non_negative_integer("tuning_starts", tuning_starts),
        seed + _TUNING_SEED,
        room,
    )

    def runs(name: str, scale: float, over: Sequence[Array], what: str) -> MethodResult:
        done = []
        for k, start in enumerate(over):
            on_progress(f"{name} from {what} {k + 1} of {len(over)}")
            done.append(_run(replace(scenario, start=start), name, scale))
        return MethodResult(name, tuple(done), scale)

    results = []
    for name in dict.fromkeys(methods):
        tried = [runs(name, scale, tuning, "tuning start") for scale in SCALES if tuning]
        scale = min(tried, key=_rank).scale if tried else 1.0
        results.append(runs(name, scale, [scenario.start, *others], "start"))
    return Comparison(scenario.name, seed, tuple(results), tuning_starts)


def _with_equal_limits(scenario: Scenario, seed: int | None) -> Scenario:
    return replace(
        scenario,
        seed=scenario.seed if seed is None else seed,
        timing=TimingParameters(LIMIT_SHARE, LIMIT_SHARE, LIMIT_SHARE),
        speed=SpeedParameters(braking_share=LIMIT_SHARE, velocity_share=LIMIT_SHARE),
    )


def _rank(result: MethodResult) -> tuple[int, float]:
    """Return what orders results from the best: fewest failures, then the smallest median time."""
    time = result.median("time_s")
    return -result.count(Outcome.REACHED), np.inf if time is None else time


def _run(scenario: Scenario, name: str, scale: float) -> MethodRun:
    timed: list[TimedController] = []

    def method(scenario: Scenario, clearance: Clearance) -> Drive | NoPath:
        drive = METHODS[name](scenario, clearance, scale)
        if isinstance(drive, NoPath):
            return drive
        timed.append(TimedController(drive.controller))
        return replace(drive, controller=timed[0])

    try:
        run = run_closed_loop(scenario, method)
    except (ValueError, ArithmeticError, RuntimeError) as error:
        return MethodRun(_positions(scenario), FAILED, str(error))
    seconds = timed[0].seconds if timed else []
    return _measured(run, float(np.median(seconds)) * 1e6 if seconds else None)


def _measured(run: Trajectory, step_us: float | None) -> MethodRun:
    arm, dt = run.scenario.arm, run.scenario.simulation.dt
    smallest = float(run.clearance.min())
    steps: Array = arm.difference(run.q[:-1], run.q[1:])
    return MethodRun(
        start=_positions(run.scenario),
        outcome=str(run.outcome),
        detail=run.detail,
        time_s=float(run.time[-1]),
        path_length_rad=float(np.linalg.norm(steps, axis=1).sum()),
        min_clearance_m=smallest if np.isfinite(smallest) else None,
        effort=float((run.tau[:-1] ** 2).sum() * dt),
        plan_time_s=run.plan_time,
        preparation_time_s=run.preparation_time,
        step_us=step_us,
    )


def _positions(scenario: Scenario) -> tuple[float, ...]:
    return tuple(scenario.arm.angles(scenario.start).tolist())
