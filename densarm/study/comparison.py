"""Comparison: every baseline from every start, under the same conditions, limits and tuning."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from densarm.control.controller import Controller
from densarm.control.speed_law import SpeedParameters
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.planning.motion import TimingParameters
from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import Drive, run_by
from densarm.scenarios.scenario import Scenario
from densarm.study.baselines import BASELINES, DENSITIES, MAIN_PARAMETERS
from densarm.study.cluster import in_order
from densarm.study.conditions import Condition
from densarm.study.measures import path_length
from densarm.values.arrays import Array
from densarm.values.checks import non_negative_integer, positive_integer
from densarm.values.outcome import FAILED, RUN_ENDS, Outcome
from densarm.values.progress import OnProgress
from densarm.world.configurations import clear_configurations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIMIT_SHARE = 0.9
"""Share of the velocity, acceleration and torque limits that every baseline plans with."""

_WIDEST = 5.0  # factor of the default of a main parameter that tuning tries, and its inverse
_TUNING_SEED = 1_000_003  # added to the seed of the starts that are not tuned on
_START_MARGIN = 0.005  # [m], that random starts keep beyond the safety margin
_PANELS = {  # of the figure: label and scale of a measure
    "time_s": ("time [s]", 1.0),
    "path_length_rad": ("path [rad]", 1.0),
    "min_clearance_m": ("smallest clearance [mm]", 1e3),
    "effort": ("effort ∫τ² dt [N²m²s]", 1.0),
    "step_us": ("step [µs]", 1.0),
}


@dataclass(frozen=True)
class BaselineRun:
    """One baseline from one start."""

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


MEASURES = tuple(item.name for item in fields(BaselineRun)[3:])
"""What is measured on a run, as `BaselineRun` calls it."""


@dataclass(frozen=True)
class BaselineResult:
    """One baseline from all starts under one condition."""

    baseline: str
    runs: tuple[BaselineRun, ...]
    scale: float = 1.0
    """Of its main parameter, as tuning chose it."""
    value: float = 0.0
    """Of that parameter, in the unit of `MAIN_PARAMETERS`."""
    condition: Condition = field(default_factory=Condition)
    """What was done to the arm."""

    @property
    def parameter(self) -> str:
        """Name of its main parameter."""
        return MAIN_PARAMETERS[self.baseline].name

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
            "method": self.baseline,
            "condition": vars(self.condition),
            "parameter": self.parameter,
            "scale": self.scale,
            "value": self.value,
            **{outcome: self.count(outcome) for outcome in RUN_ENDS},
            **{measure: self.median(measure) for measure in MEASURES},
            "runs": [vars(run) for run in self.runs],
        }


@dataclass(frozen=True)
class Comparison:
    """All baselines from all starts under all conditions."""

    scenario: str
    seed: int
    baselines: tuple[BaselineResult, ...]
    """Condition by condition, in each the baselines in their order."""
    tuning_starts: int
    """Number of other starts that the main parameters were tuned on."""
    budget: int = 1
    """Number of values that each main parameter was tried at."""

    @property
    def starts(self) -> int:
        """Number of starts."""
        return len(self.baselines[0].runs)

    def under(self, condition: Condition) -> list[BaselineResult]:
        """Return the results under a condition."""
        return [result for result in self.baselines if result.condition == condition]

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """The conditions."""
        return tuple(dict.fromkeys(result.condition for result in self.baselines))

    def rivals(self, condition: Condition) -> tuple[BaselineResult, BaselineResult] | None:
        """Return the best form of the density and the best other baseline, if there are both."""
        results = self.under(condition)
        ours = [result for result in results if result.baseline in DENSITIES]
        others = [result for result in results if result.baseline not in DENSITIES]
        return (best_of(ours), best_of(others)) if ours and others else None

    def to_json(self) -> dict[str, Any]:
        """Return JSON data; the measures of a baseline are medians."""
        return {
            "methods": [result.to_json() for result in self.baselines],
            "starts": self.starts,
            "scenario": self.scenario,
            "seed": self.seed,
            "tuning_starts": self.tuning_starts,
            "budget": self.budget,
            "limit_share": LIMIT_SHARE,
        }


def compare(
    scenario: Scenario,
    baselines: Sequence[str] = tuple(BASELINES),
    starts: int = 5,
    seed: int | None = None,
    tuning_starts: int = 3,
    on_progress: OnProgress = lambda _: None,
    *,
    conditions: Sequence[Condition] = (Condition(),),
    budget: int = 3,
    jobs: int = 1,
    scheduler: str | None = None,
) -> Comparison:
    """Run baselines from the same starts to the scenario's goal.

    All get the same arm, scene, margin, time step, time limit and gains, and plan with
    `LIMIT_SHARE` of the velocity, acceleration and torque limits; feedback may use them whole.
    Every baseline has one main parameter, `MAIN_PARAMETERS`, and all are tuned alike: of as many
    values as the budget, its default times `scales`, the one that reaches most often from the
    tuning starts, all conditions counted, then touches least often, then has the smallest median
    time, then the first. Tuning starts are drawn by another seed than the starts.

    Args:
        scenario: arm, scene, goal, limits and parameters; its own start comes first.
        baselines: names of `BASELINES`, at least one.
        starts: number of starts; all but the first are random and touch nothing.
        seed: of the starts, the planner and the conditions; None for the scenario's own.
        tuning_starts: number of starts to tune on; 0 keeps the defaults.
        on_progress: told what is being done.
        conditions: what is done to the arm; every baseline meets the same from the same start.
        budget: number of values of its main parameter that tuning tries on every baseline.
        jobs: processes on this machine; 1 for this one.
        scheduler: address of a Dask scheduler whose workers run it, in place of processes here.

    Returns:
        How each run ended. A run that raises an error counts as failed and stops no other.

    Raises:
        UnknownNameError: a baseline that there is not.
        InvalidValueError: a number of starts or a budget below one, of tuning starts below zero, a
            seed that is not a whole number, or a scenario of steps or that commands velocities.
        DensarmError: no random start was found, or what `as_completed` raises.
    """
    for name in baselines:
        if name not in BASELINES:
            raise UnknownNameError("method", name, BASELINES)
    scenario.require_one_goal()
    if scenario.control.form == ControlForm.VELOCITY:
        raise InvalidValueError("control.form", "velocity", "one of torque, as all methods are")
    seed = scenario.seed if seed is None else seed
    scenario = replace(
        scenario,
        seed=seed,
        timing=TimingParameters(LIMIT_SHARE, LIMIT_SHARE, LIMIT_SHARE),
        speed=SpeedParameters(braking_share=LIMIT_SHARE, velocity_share=LIMIT_SHARE),
    )
    n_others = positive_integer("starts", starts) - 1
    n_tuning = non_negative_integer("tuning_starts", tuning_starts)
    tried = scales(positive_integer("budget", budget))
    margin = scenario.control.margin + _START_MARGIN
    others = clear_configurations(scenario.world, n_others, seed, margin)
    tuning = clear_configurations(scenario.world, n_tuning, seed + _TUNING_SEED, margin)

    def results(asked: Sequence[_Asked], over: Sequence[Array], drawn: int) -> list[BaselineResult]:
        what = "run" if drawn == seed else "tuning run"
        items = [(*one, k) for one in asked for k in range(len(over))]

        def tell(count: int) -> None:
            on_progress(f"{what} {count} of {len(items)}")

        runs = in_order(partial(_run, scenario, over, drawn), items, jobs, scheduler, tell)
        found, size = [], len(over)
        for k, (name, scale, condition) in enumerate(asked):
            tuned = name in MAIN_PARAMETERS
            value = scale * MAIN_PARAMETERS[name].default(scenario) if tuned else 0.0
            own = tuple(runs[k * size : (k + 1) * size])
            found.append(BaselineResult(name, own, scale, value, condition))
        return found

    chosen = dict.fromkeys(baselines, 1.0)
    if tuning:
        asked = list(product(chosen, tried, conditions))
        by = iter(results(asked, tuning, seed + _TUNING_SEED))
        for name in chosen:
            each = [[next(by) for _ in conditions] for _ in tried]
            whole = [replace(per[0], runs=sum((r.runs for r in per), ())) for per in each]
            chosen[name] = best_of(whole).scale
    asked = [(*method, condition) for condition in conditions for method in chosen.items()]
    found = results(asked, [scenario.start, *others], seed)
    return Comparison(scenario.name, seed, tuple(found), tuning_starts, budget)


_Asked = tuple[str, float, Condition]  # a baseline, its main parameter's scale, and a condition


def scales(budget: int) -> list[float]:
    """Return as many multiples of a default: one, then ever farther below and above, to 1/5 and 5.

    They are even in their logarithms; a budget of three has 1, 0.2 and 5.
    """
    rounds = max(1, budget // 2)
    steps = [sign * k / rounds for k in range(1, rounds + 1) for sign in (-1.0, 1.0)]
    return [1.0, *(_WIDEST**step for step in steps)][:budget]


def best_of(results: Sequence[BaselineResult]) -> BaselineResult:
    """Return the first that reaches most often, then touches least, then is the fastest."""
    return min(results, key=_rank)


def comparison_figure(comparison: Comparison) -> "Figure":
    """Plot how the runs of each baseline ended, and the measures of those that reached the goal."""
    # Matplotlib takes a second to import.
    from matplotlib.ticker import MaxNLocator

    from densarm.visualization.figure_style import BLACK, BLUE, END_COLOUR, new_figure

    results, rows = comparison.baselines, range(len(comparison.baselines))
    figure = new_figure(10.0, 2.4 + 0.55 * len(rows))
    figure.suptitle(
        f"{comparison.scenario}, {comparison.starts} starts: a dot a run that reached the goal, "
        "a line at the median (steps: of all runs)"
    )
    outcomes, *panels = figure.subplots(2, 3, sharey=True).ravel()
    left = np.zeros(len(rows))
    for outcome in RUN_ENDS:
        counts = np.array([result.count(outcome) for result in results])
        if counts.any():
            bars = {"color": END_COLOUR[outcome], "label": outcome}
            outcomes.barh(rows, counts, left=left, height=0.6, **bars)
            left += counts
    outcomes.set_xlim(0, comparison.starts)
    outcomes.set_xlabel("runs")
    outcomes.xaxis.set_major_locator(MaxNLocator(integer=True))
    outcomes.set_yticks(rows, [_label(result) for result in results])
    for axes, (measure, (label, scale)) in zip(panels, _PANELS.items(), strict=True):
        for row, result in enumerate(results):
            values = scale * np.array(result.values(measure))
            axes.plot(values, np.full(len(values), row), "o", color=BLUE, markersize=4, alpha=0.5)
            if values.size:
                axes.plot(
                    [np.median(values)] * 2, [row - 0.3, row + 0.3], color=BLACK, linewidth=1.5
                )
        axes.set_xlim(left=0.0)
        axes.grid(axis="x", alpha=0.3)
        axes.set_xlabel(label)
    outcomes.set_ylim(len(rows) - 0.5, -0.5)
    figure.legend(loc="outside lower center", ncols=len(RUN_ENDS), frameon=False)
    return figure


def _label(result: BaselineResult) -> str:
    is_disturbed = result.condition != Condition()
    return f"{result.baseline}, {result.condition.name}" if is_disturbed else result.baseline


class TimedController:
    """Passes everything on to a controller, and keeps the time of each of its steps.

    Args:
        controller: what is measured.
        seconds: to which the duration of each call of `torque` is added [s].
    """

    def __init__(self, controller: Controller, seconds: list[float]) -> None:
        self._controller = controller
        self._seconds = seconds

    def __getattr__(self, name: str) -> Any:
        return getattr(self._controller, name)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        began = time.perf_counter()
        tau = self._controller.torque(t, q, v)
        self._seconds.append(time.perf_counter() - began)
        return tau


def _rank(result: BaselineResult) -> tuple[int, int, float]:
    median = result.median("time_s")
    reached, touched = result.count(Outcome.REACHED), result.count(Outcome.COLLIDED)
    return -reached, touched, np.inf if median is None else median


def _run(
    scenario: Scenario, starts: Sequence[Array], seed: int, item: tuple[str, float, Condition, int]
) -> BaselineRun:
    name, scale, condition, k = item
    scenario, seconds = replace(scenario, start=starts[k]), list[float]()

    def baseline(scenario: Scenario) -> Drive:
        drive = BASELINES[name](scenario, scale)
        return replace(drive, controller=TimedController(drive.controller, seconds))

    start = tuple(scenario.arm.angles(scenario.start).tolist())
    try:
        scenario, plant = condition.applied(scenario, (seed, k))
        run = run_by(scenario, baseline, plant=plant)
    except (ValueError, ArithmeticError, RuntimeError) as error:
        return BaselineRun(start, FAILED, str(error))
    smallest = float(run.clearance.min())
    return BaselineRun(
        start=start,
        outcome=str(run.outcome),
        detail=run.detail,
        time_s=float(run.time[-1]),
        path_length_rad=path_length(run),
        min_clearance_m=smallest if np.isfinite(smallest) else None,
        effort=float((run.tau[:-1] ** 2).sum() * scenario.simulation.dt),
        plan_time_s=run.plan_time,
        preparation_time_s=run.preparation_time,
        step_us=float(np.median(seconds)) * 1e6 if seconds else None,
    )
