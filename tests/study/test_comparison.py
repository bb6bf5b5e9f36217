"""A comparison: the same starts for all, every run counted, failures recorded."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.scenarios.run import Drive
from densarm.scenarios.scenario import Scenario
from densarm.study.baselines import BASELINES, MAIN_PARAMETERS
from densarm.study.comparison import (
    LIMIT_SHARE,
    MEASURES,
    Comparison,
    TimedController,
    compare,
    scales,
)
from densarm.study.conditions import Condition
from densarm.values.arrays import Array
from densarm.values.outcome import RUN_ENDS, Outcome

NAMES = ("density_direct", "potential_field")


@pytest.fixture(scope="module")
def comparison(swing_up: Scenario) -> Comparison:
    short = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=8.0))
    return compare(short, NAMES, starts=3, seed=4, tuning_starts=0)


@pytest.mark.slow
def test_json_holds_counts_medians_and_runs(comparison: Comparison) -> None:
    data = json.loads(json.dumps(comparison.to_json(), allow_nan=False))
    assert list(data) == [
        *("methods", "starts", "scenario", "seed", "tuning_starts", "budget", "limit_share"),
    ]
    assert (data["starts"], data["scenario"], data["seed"]) == (3, "swing_up", 4)
    assert [entry["method"] for entry in data["methods"]] == list(NAMES)
    for entry in data["methods"]:
        told = ["method", "condition", "parameter", "scale", "value"]
        assert list(entry) == [*told, *RUN_ENDS, *MEASURES, "runs"]
        assert entry["condition"] == {"push": 0.0, "payload": 0.0, "moving": 0.0}
        assert (entry["scale"], entry["value"]) == (1.0, 0.05)
        assert sum(entry[outcome] for outcome in RUN_ENDS) == len(entry["runs"]) == 3
        reached = [run["time_s"] for run in entry["runs"] if run["outcome"] == "reached"]
        assert entry["time_s"] == pytest.approx(np.median(reached))
        assert all(run["step_us"] > 0.0 for run in entry["runs"])


@pytest.mark.slow
def test_all_start_alike_and_first_from_the_scenario(
    swing_up: Scenario, comparison: Comparison
) -> None:
    first, second = ([run.start for run in result.runs] for result in comparison.baselines)
    assert first == second
    assert len(set(first)) == 3
    np.testing.assert_allclose(first[0], swing_up.arm.angles(swing_up.start))


@pytest.mark.slow
def test_measures_are_those_of_the_record(swing_up: Scenario, comparison: Comparison) -> None:
    run = comparison.baselines[0].runs[-1]
    assert run.min_clearance_m is not None
    assert run.path_length_rad is not None
    assert run.effort is not None
    assert run.time_s is not None
    assert run.outcome == Outcome.REACHED
    straight = swing_up.arm.difference(swing_up.arm.configuration(run.start), swing_up.goal)
    assert np.linalg.norm(straight) - 0.01 < run.path_length_rad < 2.0 * np.linalg.norm(straight)
    assert 0.0 < run.min_clearance_m < 1.25
    assert 0.0 < run.effort < run.time_s * np.sum(swing_up.arm.limits.effort**2)


@pytest.mark.slow
def test_a_run_that_raises_is_recorded(swing_up: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    def raises(scenario: Scenario, scale: float) -> Drive:
        if (scenario.start == swing_up.start).all():
            raise InvalidValueError("gain", 0.0, "positive")
        return BASELINES["density_direct"](scenario, scale)

    monkeypatch.setattr("densarm.study.comparison.BASELINES", {"odd": raises})
    result = compare(swing_up, ["odd"], starts=2, seed=4, tuning_starts=0).baselines[0]
    assert result.runs[0].outcome == "failed"
    assert result.runs[0].detail == "gain = 0.0: must be positive"
    assert result.runs[1].outcome == Outcome.REACHED
    assert result.count("failed") == 1


def test_infeasible_for_all(swing_up: Scenario) -> None:
    contact = swing_up.arm.configuration([1.2, 0.0])
    comparison = compare(replace(swing_up, start=contact), NAMES, starts=1, tuning_starts=0)
    for result in comparison.baselines:
        assert result.count("infeasible") == 1
        assert result.median("time_s") is None
        assert result.median("step_us") is None


@pytest.mark.slow
def test_a_baseline_given_twice_runs_once(swing_up: Scenario) -> None:
    comparison = compare(swing_up, ["potential_field"] * 2, starts=1, tuning_starts=0)
    assert [result.baseline for result in comparison.baselines] == ["potential_field"]


@pytest.mark.slow
def test_progress_counts_runs(swing_up: Scenario) -> None:
    told: list[str] = []
    short = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=0.2))
    compare(short, ["potential_field"], 1, tuning_starts=1, on_progress=told.append)
    tuning = [f"tuning run {k} of 3" for k in range(1, len(scales(3)) + 1)]
    assert told == [*tuning, "run 1 of 1"]


Odd = list[tuple[Any, float, Scenario]]


@pytest.fixture
def runs_of_odd(monkeypatch: pytest.MonkeyPatch) -> Odd:
    """Every (start, scale, scenario) that an odd baseline was run at; the last scale reaches."""
    seen: Odd = []

    def odd(scenario: Scenario, scale: float) -> Drive:
        seen.append((scenario.start.tolist(), scale, scenario))
        if scale != scales(3)[-1]:
            raise InvalidValueError("gain", 0.0, "positive")
        return BASELINES["density"](scenario)

    monkeypatch.setattr("densarm.study.comparison.BASELINES", {"odd": odd})
    return seen


@pytest.mark.slow
def test_tuning_takes_the_scale_that_reaches_on_other_starts(
    swing_up: Scenario, runs_of_odd: Odd
) -> None:
    result = compare(swing_up, ["odd"], starts=2, seed=4, tuning_starts=1).baselines[0]
    assert result.scale == scales(3)[-1]
    tuned, counted = runs_of_odd[: len(scales(3))], runs_of_odd[len(scales(3)) :]
    assert [scale for _, scale, _ in tuned] == list(scales(3))
    assert [scale for _, scale, _ in counted] == [scales(3)[-1]] * 2
    assert not any(start == tuned[0][0] for start, _, _ in counted)


def test_all_plan_with_the_same_share_of_the_limits(swing_up: Scenario, runs_of_odd: Odd) -> None:
    compare(swing_up, ["odd"], starts=1, tuning_starts=0)
    scenario = runs_of_odd[0][2]
    shares = {**vars(scenario.timing), **vars(scenario.speed)}
    assert shares.pop("jerk") is None
    assert set(shares.values()) == {LIMIT_SHARE}


@pytest.mark.slow
def test_every_condition_is_tuned_on_and_met_by_every_method(
    swing_up: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, float, tuple[str, ...], list[float]]] = []

    def named(name: str) -> Callable[[Scenario, float], Drive]:
        def drive(scenario: Scenario, scale: float) -> Drive:
            obstacles = tuple(item.name for item in scenario.scene)
            calls.append((name, scale, obstacles, scenario.start.tolist()))
            return BASELINES["cbf_qp"](scenario, scale)

        return drive

    for name in NAMES:
        monkeypatch.setitem(BASELINES, name, named(name))
    simulation = replace(swing_up.simulation, time_limit=0.1)
    conditions = [Condition(), Condition(push=1.0), Condition(moving=0.5)]
    short = replace(swing_up, simulation=simulation)
    found = compare(short, NAMES, 2, 4, 1, conditions=conditions, budget=2)
    assert len(calls) == 2 * (2 * 3 * 1 + 3 * 2)
    per_method = [[call[1:] for call in calls if call[0] == name] for name in NAMES]
    assert per_method[0] == per_method[1]
    tuned, counted = per_method[0][:6], per_method[0][6:]
    assert [scale for scale, *_ in tuned] == [1.0] * 3 + [0.2] * 3
    assert {start[0] for *_, start in tuned}.isdisjoint({start[0] for *_, start in counted})
    assert found.conditions == tuple(conditions)
    assert [len(found.under(condition)) for condition in conditions] == [2, 2, 2]
    ours, theirs = found.rivals(Condition()) or (None, None)
    assert (ours and ours.baseline, theirs and theirs.baseline) == NAMES


def test_what_follows_a_density_goes_on_among_obstacles_that_move(swing_up: Scenario) -> None:
    brief = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=2.0))
    found = compare(brief, NAMES[:1], 1, 4, 0, conditions=[Condition(moving=0.5)]).baselines[0]
    assert found.count("failed") == 0


def test_scales_go_out_from_the_default() -> None:
    assert scales(1) == [1.0]
    assert scales(3) == pytest.approx([1.0, 0.2, 5.0])
    assert scales(5) == pytest.approx([1.0, 5**-0.5, 5**0.5, 0.2, 5.0])
    assert [len(scales(budget)) for budget in range(1, 9)] == list(range(1, 9))


def test_every_baseline_has_a_main_parameter() -> None:
    assert list(MAIN_PARAMETERS) == list(BASELINES)


def test_wrong_input(swing_up: Scenario) -> None:
    with pytest.raises(UnknownNameError, match="unknown method 'densty'; did you mean 'density'"):
        compare(swing_up, ["densty"])
    with pytest.raises(InvalidValueError, match="starts = 0"):
        compare(swing_up, NAMES, starts=0)
    with pytest.raises(InvalidValueError, match="seed"):
        compare(swing_up, NAMES, starts=1, seed=-1)
    with pytest.raises(InvalidValueError, match="tuning_starts = -1"):
        compare(swing_up, NAMES, starts=1, tuning_starts=-1)
    with pytest.raises(InvalidValueError, match="budget = 0"):
        compare(swing_up, NAMES, starts=1, budget=0)


class Echo:
    tracking_error = 0.25

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        return np.asarray(t + np.asarray(q) + np.asarray(v), np.float64)


def test_a_timed_controller_passes_all_on_and_keeps_times() -> None:
    seconds: list[float] = []
    controller = TimedController(Echo(), seconds)
    np.testing.assert_array_equal(controller.torque(1.0, [2.0], [3.0]), [6.0])
    controller.torque(0.0, [0.0], [0.0])
    assert len(seconds) == 2
    assert min(seconds) >= 0.0
    assert controller.tracking_error == 0.25
    with pytest.raises(AttributeError):
        controller.motion  # noqa: B018
