"""Lead the density by sub-goals of one's own: a guide has one method.

python examples/own_guide.py
"""

import numpy as np

import densarm
from densarm.values.arrays import Array

DRAWN_BACK = [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8]  # [rad]


class DrawBackFirst:
    """Go by way of one posture; what is between is for the density to bend."""

    def plan(self, start: Array, goal: Array, seed: int) -> densarm.GuidePath | densarm.NoPath:
        """Return start, posture and goal; the straight way between them is not claimed clear."""
        return densarm.GuidePath(np.array([start, DRAWN_BACK, goal]), is_clear=False)


def main() -> None:
    scenario = densarm.load_scenario("panda_table")
    motion = densarm.plan_motion(scenario.world, scenario.start, scenario.goal, DrawBackFirst())
    controller = densarm.DensityTracking(scenario.world, motion)
    run = densarm.simulate(scenario.world, controller, scenario.start)
    print(f"{run.outcome} after {run.time[-1]:.2f} s, certified: {run.certified}")


if __name__ == "__main__":
    main()
