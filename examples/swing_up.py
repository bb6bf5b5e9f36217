"""Swing a two-link arm from hanging to upright by the density alone, and prove it.

python examples/swing_up.py --out .
"""

import argparse
from pathlib import Path

import densarm


def main(out: Path) -> None:
    run = densarm.run("swing_up")  # no planner: guide = "direct", V weighted by inertia

    print(run.outcome.description)
    print(run.remark)
    print(f"after {run.time[-1]:.2f} s, {run.goal_error:.1e} rad from the goal")
    print(f"never closer than {run.clearance.min() * 1e3:.1f} mm to an obstacle")
    for check in run.certificate.checks:
        print(f"{check.name}: {'proved' if check.holds else 'not proved'}, {check.detail}")

    run.save(out / "swing_up.npz")
    densarm.save_html(run, out / "swing_up.html")
    densarm.save_plot(run, out / "swing_up.png")  # joint space, with ln ρ and the motion


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    main(parser.parse_args().out)
