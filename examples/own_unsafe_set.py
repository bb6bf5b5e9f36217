"""Keep out of more than obstacles: python examples/own_unsafe_set.py."""

import numpy as np

import densarm
from densarm.values.arrays import Array

CENTRE, RADIUS, SENSED = np.array([0.0, 0.55]), 0.2, 0.2  # of the first two joints [rad]


class Disc:  # an unsafe set has one method
    """Forbid a disc of two joints, by Ψ = 1 - (1 - h/σ)² where its distance h is below σ."""

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Return ln Ψ at q, and add its gradient."""
        offset, distance = q[:2] - CENTRE, float(np.linalg.norm(q[:2] - CENTRE))
        near = 1.0 - (distance - RADIUS) / SENSED
        if near <= 0.0:
            return 0.0
        psi = max(1.0 - near**2, 1e-12)
        out_gradient[:2] += 2.0 * near / (psi * SENSED * distance) * offset
        return float(np.log(psi))


def main() -> None:
    arm = densarm.load_arm("panda")
    world = densarm.World(arm, densarm.Scene([]))
    start = arm.configuration([-0.8, 0.6, 0.0, -2.0, 0.0, 2.0, 0.8])  # [rad]
    goal = arm.configuration([0.8, 0.6, 0.0, -2.0, 0.0, 2.0, 0.8])  # [rad]
    for unsafe in ([], [Disc()]):
        law = densarm.DensityRegulation(world, goal, unsafe_sets=unsafe)
        run = densarm.simulate(world, law, start)
        nearest = np.linalg.norm(run.q[:, :2] - CENTRE, axis=1).min()
        print(f"{run.outcome}, {nearest:.2f} rad from the middle of the disc at least")


if __name__ == "__main__":
    main()
