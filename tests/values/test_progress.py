"""Progress: a line below the cell of a notebook while something lasts, and nowhere else."""

import sys
from types import SimpleNamespace

import pytest

import densarm
from densarm.study.monte_carlo import Study, run_study
from densarm.values.progress import is_in_notebook, shown_progress


@pytest.fixture
def below_cell(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Whatever lines a notebook shows, one after another."""
    shown: list[str] = []

    def display(text: str, display_id: bool) -> SimpleNamespace:
        assert display_id
        shown.append(text)
        return SimpleNamespace(update=shown.append)

    displays = SimpleNamespace(HTML=lambda text: text, display=display)
    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()), display=displays)
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    return shown


def test_no_kernel_no_notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "IPython", None)
    assert not is_in_notebook()
    terminal = SimpleNamespace(get_ipython=SimpleNamespace)
    monkeypatch.setitem(sys.modules, "IPython", terminal)
    assert not is_in_notebook()
    with shown_progress(None) as tell:
        tell("unheard")


def test_a_line_below_the_cell_goes_when_all_is_done_or_fails(below_cell: list[str]) -> None:
    @shown_progress(None)
    def break_off() -> None:
        raise ValueError("broken")

    with shown_progress(None) as tell:
        tell("1 of <2>")
    assert below_cell == ["", "<small>1 of &lt;2&gt;</small>", ""]
    below_cell.clear()
    with pytest.raises(ValueError, match="broken"):
        break_off()
    assert below_cell == ["", ""]


def test_who_is_given_is_told_instead(below_cell: list[str]) -> None:
    told: list[str] = []
    with shown_progress(told.append) as tell:
        tell("planning")
    assert told == ["planning"]
    assert not below_cell


def test_a_run_shows_its_progress(below_cell: list[str]) -> None:
    densarm.run("swing_up")
    assert below_cell[1] == "<small>planning</small>"
    assert "simulated" in below_cell[-2]
    assert not below_cell[-1]


def test_a_study_shows_its_own_progress_not_that_of_its_runs(below_cell: list[str]) -> None:
    run_study(Study(densarm.load_scenario("swing_up")), 2)
    assert "0 of 2 runs" in below_cell[1]
    assert "2 of 2 runs" in below_cell[-2]
    assert not any("simulated" in line for line in below_cell)
