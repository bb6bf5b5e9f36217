"""Turn a bar to fit through a window: by velocity, proved clear, and by force and torque.

python examples/free_body.py --out .
"""

import argparse
from pathlib import Path

import densarm

WALL = {  # around a window of 0.4 m by 0.4 m: position and size [m]
    "left": ((0.0, 0.6, 0.0), (0.1, 0.8, 2.0)),
    "right": ((0.0, -0.6, 0.0), (0.1, 0.8, 2.0)),
    "above": ((0.0, 0.0, 0.6), (0.1, 0.4, 0.8)),
    "below": ((0.0, 0.0, -0.6), (0.1, 0.4, 0.8)),
}


def main(out: Path) -> None:
    bar = densarm.free_body(
        densarm.Box(name="bar", size=[0.06, 0.6, 0.06]),  # [m]
        "rigid body",
        bounds=[(-0.8, 0.8), (-0.5, 0.5), (-0.5, 0.5)],  # [m]
        name="bar",
    )
    wall = [
        densarm.Box(name=name, position=position, size=size)
        for name, (position, size) in WALL.items()
    ]
    world = densarm.World(bar, densarm.Scene(wall))
    start = bar.configuration([-0.6, 0.0, 0.0, 0.0, 0.0, 0.0])  # [m], [rad]
    goal = bar.configuration([0.6, 0.0, 0.0, 0.0, 0.0, 1.5])  # [m], [rad]
    steps = densarm.SimulationParameters(dt=0.005)  # [s]

    path = densarm.plan_path(world, start, goal).path
    regulation = densarm.DensityRegulation(world, goal, path=path, period=steps.dt)
    plant = densarm.SingleIntegrator(bar, steps.dt)
    run = densarm.simulate(world, regulation, start, plant=plant, parameters=steps)
    swept = run.certificate.checks[0]
    print(f"by velocity: {run.outcome} after {run.time[-1]:.2f} s, {swept.detail}")

    motion = densarm.plan_motion(world, start, goal, period=steps.dt)
    tracking = densarm.DensityTracking(world, motion)
    run = densarm.simulate(world, tracking, start, parameters=steps)
    print(f"by force: {run.outcome} after {run.time[-1]:.2f} s, certified: {run.certified}")
    print(f"clearance at least {run.clearance.min() * 1e3:.1f} mm")
    densarm.save_html(run, out / "free_body.html")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    main(parser.parse_args().out)
