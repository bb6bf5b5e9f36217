"""Swing a two-link arm from hanging to upright between two obstacles, and prove it.

python examples/swing_up.py --out .
"""

import argparse
from pathlib import Path

import densarm


def main(out: Path) -> None:
    run = densarm.run("swing_up")

    print(run.outcome.description)
    print(f"after {run.time[-1]:.2f} s, {run.goal_error:.1e} rad from the goal")
    print(f"never closer than {run.clearance.min() * 1e3:.1f} mm to an obstacle")
    for check in run.certificate.checks:
        print(f"{check.name}: {'proved' if check.holds else 'not proved'}, {check.detail}")

    run.save(out / "swing_up.npz")
    densarm.save_html(run, out / "swing_up.html")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    main(parser.parse_args().out)
