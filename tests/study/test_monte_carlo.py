"""Studies: what the index of a run determines, the file, and who runs it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from densarm.errors import DensarmError, FileContentError, InvalidValueError, UnknownNameError
from densarm.scenarios.scenario import Scenario
from densarm.simulation.disturbances import Disturbances
from densarm.study.monte_carlo import Rows, Study, run_study, share, study_figure

VARY = {"disturbances.payload": (0.0, 0.1), "planning.searches": (1.0, 3.0)}


@pytest.fixture
def study(swing_up: Scenario) -> Study:
    noisy = replace(swing_up, disturbances=Disturbances(encoder_noise=1e-5))
    return Study(noisy, seed=3, vary=VARY)


def test_index_determines_start_parameters_and_noise(study: Study) -> None:
    again = Study(study.scenario, seed=3, vary=dict(reversed(VARY.items())))
    cases = [study.case(index) for index in range(20)]
    for index in (0, 7):
        one, two = cases[index], again.case(index)
        np.testing.assert_array_equal(one.start, two.start)
        assert one.disturbances == two.disturbances
        assert one.planning == two.planning
    assert len({tuple(case.start) for case in cases}) == 20
    assert len({case.disturbances.seed for case in cases}) == 20
    assert {case.planning.searches for case in cases} == {1, 2, 3}
    for case in cases:
        assert case.world.distances(case.start).min() > 0.0
        assert 0.0 <= case.disturbances.payload <= 0.1
        assert case.disturbances.encoder_noise == 1e-5


def test_seeds_differ(study: Study) -> None:
    other = replace(study, seed=4)
    assert (other.case(0).start != study.case(0).start).any()
    assert other.values(0) != study.values(0)


@pytest.mark.slow
def test_numbers_are_the_same_whoever_runs_them(study: Study, tmp_path: Path) -> None:
    one = run_study(study, 6)
    assert share(one, "reached", certified=True).count == 6
    assert set(one["varied"][:, 1]) <= {1.0, 2.0, 3.0}
    two = run_study(study, 6, jobs=2, save=tmp_path / "two.npz")
    assert two.tobytes() == one.tobytes()

    def interrupt(phrase: str) -> None:
        if phrase.startswith("3 of 6"):
            raise KeyboardInterrupt

    path = tmp_path / "interrupted.npz"
    with pytest.raises(KeyboardInterrupt):
        run_study(study, 6, save=path, on_progress=interrupt)
    with np.load(path) as kept:
        assert (kept["outcome"] == "reached").sum() == 3
    told: list[str] = []
    resumed = run_study(study, 6, save=path, on_progress=told.append)
    assert resumed.tobytes() == one.tobytes()
    assert told[0].startswith("3 of 6")
    with np.load(path) as kept, np.load(tmp_path / "two.npz") as beside:
        assert all(kept[name].tobytes() == beside[name].tobytes() for name in kept.files)


def test_file_is_gone_on_with_by_more_starts_and_no_others(
    swing_up: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(case: Scenario, **_: object) -> None:
        raise ArithmeticError(f"{case.name} fails")

    monkeypatch.setattr("densarm.study.monte_carlo.run", fail)
    path, study = tmp_path / "study.npz", Study(swing_up)
    rows = run_study(study, 3, save=path)
    assert set(rows["outcome"]) == {"failed"}
    assert set(rows["detail"]) == {"swing_up fails"}
    assert np.isnan(rows["duration_s"]).all()
    more = run_study(study, 5, save=path)
    assert more[:3].tobytes() == rows.tobytes()
    with pytest.raises(FileContentError, match="a study of 5 starts: ask for as many, not 3"):
        run_study(study, 3, save=path)
    with pytest.raises(FileContentError, match="seed 0 and not 1:"):
        run_study(replace(study, seed=1), 5, save=path)
    varied = replace(study, vary={"control.margin": (0.0, 0.001)})
    with pytest.raises(FileContentError, match=r'vary \{\} and not \{"control.margin": \[0.0, 0'):
        run_study(varied, 5, save=path)
    other = replace(study, scenario=replace(swing_up, goal=swing_up.start))
    with pytest.raises(FileContentError, match=r'checksum "[0-9a-f]{12}" and not'):
        run_study(other, 5, save=path)


@pytest.mark.parametrize("content", [b"", b"PK", b"nothing"])
def test_file_that_is_no_study(swing_up: Scenario, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "study.npz"
    path.write_bytes(content)
    with pytest.raises(FileContentError, match="not a study"):
        run_study(Study(swing_up), 3, save=path)


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("simulation.time_limt", "did you mean 'simulation.time_limit'"),
        ("paylod", "known: disturbances.payload"),
        ("disturbances.seed", "disturbances.mass_scale"),
        ("disturbances.payload_offset", "did you mean 'disturbances.payload'"),
        ("nothing", "control.KEY"),
    ],
)
def test_key_that_cannot_vary(swing_up: Scenario, key: str, near: str) -> None:
    with pytest.raises(UnknownNameError, match=near):
        Study(swing_up, vary={key: (0.0, 1.0)})


@pytest.mark.parametrize(
    ("key", "low", "high", "told"),
    [
        ("control.margin", 0.1, 0.0, "two numbers, LOW <= HIGH"),
        ("control.margin", 0.0, np.inf, "a finite number"),
        ("control.margin", -0.1, 0.0, r"control.margin = -0.1: must be a finite number >= 0"),
        ("planning.searches", 1.0, 1.5, "two whole numbers"),
    ],
)
def test_range_that_is_none(
    swing_up: Scenario, key: str, low: float, high: float, told: str
) -> None:
    with pytest.raises(InvalidValueError, match=told):
        Study(swing_up, vary={key: (low, high)})


def test_start_that_is_nowhere(swing_up: Scenario) -> None:
    with pytest.raises(DensarmError, match="random configurations"):
        run_study(Study(swing_up, vary={"control.margin": (9.0, 9.0)}), 3)


def ended(study: Study, outcomes: list[str]) -> Rows:
    rows = np.zeros(len(outcomes), study.dtype)
    rows["outcome"] = outcomes
    rows["certified"] = [outcome == "reached" for outcome in outcomes]
    rows["min_clearance_m"] = np.linspace(0.0, 0.1, len(outcomes))
    return rows


def test_figure_has_map_shares_and_clearances(study: Study) -> None:
    figure = study_figure(study, ended(study, [*["reached"] * 8, "stuck", "failed"]))
    basin, shares, clearances = figure.axes
    assert basin.get_xlabel() == "shoulder [rad]"
    labels = set(basin.get_legend_handles_labels()[1])
    assert labels == {"reached, certified", "stuck, not certified", "failed, not certified", "goal"}
    names = [text.get_text() for text in shares.get_yticklabels()]
    assert names == ["reached\nand certified", "reached", "stuck", "failed"]
    assert [text.get_text() for text in shares.texts] == ["8", "8", "1", "1"]
    assert clearances.get_legend_handles_labels()[1] == ["reached", "stuck", "failed"]
