"""Compare the control step with those of pin-pink, mink and cbfpy on the same task.

    pip install '.[peers]'
    python benchmarks/peers.py --json peers.json --figure peers.png

Panda follows a swing among spheres. Every library gets the same arm, shapes, pairs, limits and
states, one after the other in turns, one thread each, and is set up as its documentation advises.
Times are CPU time of the process; first distances and gradients alone, then the whole command.
A peer that is not installed is left out, and that is said.
"""

import argparse
import os
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from timing.surroundings import SINGLE_THREAD, print_surroundings, surroundings

TASKS = (("capsule", "scattered"), ("capsule", "close"), ("hull", "scattered"), ("hull", "close"))
BARS = {"cbfpy, elastiqp": 20.0, "cbfpy, qpax": 20.0, "mink, detection 0.1 m": 4.0}
PINK_BAR = 50.0  # with all rows
VERSIONS = (
    *("pin", "coal", "numpy", "numba", "pin-pink", "mink", "mujoco", "cbfpy", "jax"),
    *("jaxlib", "qpax", "elastiqp", "qpsolvers", "daqp"),
)
UNEQUAL = """\
What is not equal: densarm and cbfpy command torques, pin-pink and mink velocities, without
dynamics. pin-pink and cbfpy measure every pair, mink those within its detection distance, densarm
in its command those that may have come near since it last looked.
pin-pink tests all pairs for collision too, at every update of its configuration. pin-pink and mink
follow the end effector's pose with a weak pull to the joint positions, the others the joints."""


def print_table(comparison: dict[str, Any]) -> None:
    near = ", ".join(f"{n:.0f} within {r}" for r, n in comparison["pairs_within"].items())
    print(
        f"\nPanda {comparison['shapes']}s, {comparison['spheres']} {comparison['scene']} spheres,"
        f" {comparison['pairs']} pairs ({near}), {comparison['states']} steps each"
    )
    print(
        f"{'':24}{'distances, gradients':>26}{'ratio':>20}{'command':>26}{'ratio':>20}"
        f"{'pairs':>7}{'error':>9}"
    )
    for step in comparison["steps"]:
        print(
            f"{step['name']:24}{_spread(step['measure_us']):>26}{_spread(step['measure_ratio']):>20}"
            f"{_spread(step['command_us']):>26}{_spread(step['command_ratio']):>20}"
            f"{step['pairs_measured']:7.0f}{_error(step['distance_error_m']):>9}"
        )


def verdicts(comparison: dict[str, Any]) -> list[dict[str, Any]]:
    """Return for every bar whether the median ratio of the whole commands meets it."""
    bars = {**BARS, "pin-pink, all rows": PINK_BAR}
    return [
        {
            "name": step["name"],
            "bar": bars[step["name"]],
            "ratio": step["command_ratio"]["median"],
            "met": step["command_ratio"]["median"] >= bars[step["name"]],
        }
        for step in comparison["steps"]
        if step["name"] in bars
    ]


def _spread(spread: dict[str, float]) -> str:
    digits = 2 if spread["median"] < 10.0 else 1 if spread["median"] < 1000.0 else 0
    median, low, high = (f"{spread[k]:.{digits}f}" for k in ("median", "p5", "p95"))
    return f"{median} ({low}-{high})"


def _error(meters: float | None) -> str:
    return "-" if meters is None else f"{meters:.0e}"


def _available(wanted: list[str], packages: dict[str, str]) -> list[str]:
    missing = [peer for peer in wanted if find_spec(packages.get(peer, peer)) is None]
    for peer in missing:
        print(f"{peer} is not installed, and left out: pip install '.[peers]'")
    return [peer for peer in wanted if peer not in missing]


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--spheres", type=int, default=32)
    parser.add_argument("--peers", nargs="*", default=["mink", "pin-pink", "cbfpy"])
    parser.add_argument("--tasks", nargs="*", default=[f"{a}-{b}" for a, b in TASKS])
    parser.add_argument("--blocks", type=int, nargs=2, default=(10, 20), help="number and length")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path, help="PNG of the first task")
    options = parser.parse_args(arguments)
    os.environ.update(SINGLE_THREAD)

    from control_steps.comparison import PACKAGES, compare

    from densarm.cli.output import write_json

    peers = _available(options.peers, PACKAGES)
    result: dict[str, Any] = {"surroundings": surroundings(VERSIONS), "comparisons": []}
    print_surroundings(result["surroundings"])
    print("Medians (5-95 %), times in µs of CPU time, ratios to densarm in the same turn")
    for task in options.tasks:
        shapes, scene = task.split("-")
        comparison = compare(
            shapes, options.spheres, scene, peers, tuple(options.blocks), options.rounds
        )
        comparison["bars"] = verdicts(comparison)
        result["comparisons"].append(comparison)
        print_table(comparison)
        for bar in comparison["bars"]:
            met = "met" if bar["met"] else "missed"
            print(f"  bar {bar['bar']:g} x, {bar['name']}: {bar['ratio']:.1f} x, {met}", flush=True)
        if options.json:
            write_json(options.json, result)
    print("\nHow each was set up")
    for step in result["comparisons"][0]["steps"]:
        print(f"  {step['name']}: {step['set_up']}")
    print(UNEQUAL)
    if options.figure:
        from control_steps.figure import draw

        draw(result["comparisons"][0], options.figure)


if __name__ == "__main__":
    main()
