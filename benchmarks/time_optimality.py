"""Compare planned motions with the fastest ones along the same paths.

Prints, for each scenario, the time of the run, that of its planned motion, and the time-optimal one
by TOPP-RA: same path, all of the limits, no regard to stopping.

    python benchmarks/time_optimality.py [SCENARIO ...]
"""

import sys
from unittest.mock import patch

import numpy as np

import densarm
from densarm import Arm
from densarm.planning import timing
from densarm.planning.smoothing import SmoothPath
from densarm.study.measures import motion_time
from densarm.world.stopping import StoppingCheck

ALL = densarm.TimingParameters(velocity_share=1.0, acceleration_share=1.0, torque_share=1.0)


def times(name: str) -> tuple[float, float, float]:
    """Return the durations of the run, of its planned motion and of the fastest one [s]."""
    found: dict[str, float] = {}

    def remember(
        arm: Arm,
        path: SmoothPath,
        length: float,
        period: float,
        parameters: densarm.TimingParameters,
        stopping: StoppingCheck | None = None,
    ) -> densarm.Motion:
        motion = time_path(arm, path, length, period, parameters, stopping)
        found["planned"] = motion.duration
        found["fastest"] = time_path(arm, path, length, period, ALL).duration
        return motion

    time_path = timing.time_path
    with patch.object(timing, "time_path", remember):
        run = densarm.run(name)
    return motion_time(run), found["planned"], found["fastest"]


def main(names: list[str]) -> None:
    """Print one line for each scenario, and the median."""
    ratios = []
    print(f"{'scenario':<16}{'run':>10}{'planned':>12}{'optimal':>10}{'run / optimal':>16}")
    for name in names:
        run, planned, fastest = times(name)
        ratios.append(run / fastest)
        print(f"{name:<16}{run:>8.3f} s{planned:>10.3f} s{fastest:>8.3f} s{ratios[-1]:>16.2f}")
    print(f"median {np.median(ratios):.2f}")


if __name__ == "__main__":
    main(sys.argv[1:] or ["swing_up", "panda_table", "panda_shelf"])
