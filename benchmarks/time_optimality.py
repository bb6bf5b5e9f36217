"""Compare planned motions with the fastest ones along the same paths.

Prints, for each scenario, the time of the run, that of its reference, and the time-optimal one by
TOPP-RA: same path, all of the limits, no regard to stopping.

    python benchmarks/time_optimality.py [SCENARIO ...]
"""

import sys
from unittest.mock import patch

import numpy as np

import densarm
from densarm.reference import timing
from densarm.reference.timing_parameters import TimingParameters

ALL = TimingParameters(velocity_share=1.0, acceleration_share=1.0, torque_share=1.0)


def times(name: str) -> tuple[float, float, float]:
    """Return the durations of the run, of its reference and of the fastest reference [s]."""
    found = {}

    def remember(arm, path, length, period, parameters, stopping=None):
        reference = time_path(arm, path, length, period, parameters, stopping)
        found["planned"] = reference.duration
        found["fastest"] = time_path(arm, path, length, period, ALL).duration
        return reference

    time_path = timing.time_path
    with patch.object(timing, "time_path", remember):
        run = densarm.simulate(densarm.load_scenario(name))
    arrived = np.abs(run.scenario.arm.difference(run.q, run.scenario.goal)).max(axis=1) <= 0.01
    arrived &= np.abs(run.v).max(axis=1) <= 0.01
    last_away = int(np.flatnonzero(~arrived)[-1])
    return float(run.time[last_away + 1]), found["planned"], found["fastest"]


def main(names: list[str]) -> None:
    """Print one line for each scenario, and the median."""
    ratios = []
    print(f"{'scenario':<16}{'run':>10}{'reference':>12}{'optimal':>10}{'run / optimal':>16}")
    for name in names:
        run, planned, fastest = times(name)
        ratios.append(run / fastest)
        print(f"{name:<16}{run:>8.3f} s{planned:>10.3f} s{fastest:>8.3f} s{ratios[-1]:>16.2f}")
    print(f"median {np.median(ratios):.2f}")


if __name__ == "__main__":
    main(sys.argv[1:] or ["swing_up", "panda_table", "panda_shelf"])
