"""What is told of the times of control steps."""

from itertools import count

from densarm.bench import step


def test_a_single_step_follows_none():
    timing = step.time_step("two_link", pairs=2, steps=1)
    assert timing.steady_percentiles_us is None
    assert timing.resumed_us == timing.step_percentiles_us[0]


def test_steps_after_other_work_do_not_count_as_steady(monkeypatch):
    taken = count()
    monkeypatch.setattr(step, "_switches", lambda: next(taken))
    timing = step.time_step("two_link", pairs=2, steps=40)
    assert timing.switches == 40
    assert timing.steady_percentiles_us is None


def test_without_a_switch_all_but_the_first_of_a_turn_are_steady(monkeypatch):
    monkeypatch.setattr(step, "_switches", lambda: 0)
    ticks = count()
    monkeypatch.setattr(step.time, "thread_time", lambda: next(ticks) ** 2)
    timing = step.time_step("two_link", pairs=2, steps=10)
    assert timing.switches == 0
    assert timing.steady_percentiles_us[0] > timing.resumed_us
