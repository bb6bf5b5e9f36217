"""Time the control step against the bare calls on all pairs, from 8 to 1,024 pairs.

    python benchmarks/step_sizes.py --steps 100000 --json step_sizes.json --figure step_sizes.png

Each row is what `densarm bench step` measures for Panda, in a process of its own, so that memory is
that row's alone. Percentiles are of processor time. Steady is 99.9 % over 50 % of the steps that
follow a step directly, no other process in between; resumed is the first step after other calls,
which finds nothing in the caches and comes once in 4,999 steps. Undisturbed is 99.9 % over 50 % of
the least time of each state in all its visits.
10⁵ steps give the 99.9 % a hundred samples; 10⁶ show whether memory grows.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from timing.surroundings import print_surroundings, surroundings

from densarm.cli.output import write_json
from densarm.study.step import time_step

PAIRS = [8, 16, 32, 64, 128, 256, 512, 1024]


def measure(shapes: str, pairs: int, steps: int) -> dict[str, Any]:
    with ProcessPoolExecutor(1, get_context("spawn")) as process:
        timing = process.submit(time_step, "panda", shapes, pairs, steps).result()
    return {"shapes": shapes, **asdict(timing)}


def print_row(row: dict[str, Any]) -> None:
    step, alone = row["step_percentiles_us"], row["undisturbed_percentiles_us"]
    steady = row["steady_percentiles_us"] or step
    print(
        f"{row['shapes']:9}{row['pairs']:6}{row['step_us']:10.1f}{row['bare_us']:10.1f}"
        f"{row['ratio']:8.2f}{step[1]:10.1f}{step[2]:10.1f}{step[2] / step[0]:12.1f}"
        f"{steady[2] / steady[0]:8.1f}{row['resumed_us']:9.0f}{alone[2] / alone[0]:12.1f}"
        f"{row['memory_growth_kb']:10.0f}{row['collections']:6}{row['switches']:9}",
        flush=True,
    )


def draw(rows: list[dict[str, Any]], file: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for shapes, color in (("hull", "#1f4e79"), ("capsule", "#c0692b")):
        of_shapes = [row for row in rows if row["shapes"] == shapes]
        pairs = [row["pairs"] for row in of_shapes]
        for key, style, name in (("step_us", "o-", "step"), ("bare_us", "s--", "bare calls")):
            times = [row[key] for row in of_shapes]
            axes.loglog(pairs, times, style, color=color, ms=4, label=f"{shapes}s, {name}")
        largest = [row["step_percentiles_us"][2] for row in of_shapes]
        axes.loglog(pairs, largest, ":", color=color, label=f"{shapes}s, step at 99.9 %")
    axes.set_xticks(PAIRS, [str(pairs) for pairs in PAIRS])
    axes.minorticks_off()
    axes.set_xlabel("geometry pairs")
    axes.set_ylabel("time [µs]")
    axes.set_title("One control step of Panda", size=11)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(file, dpi=150)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=int, nargs="*", default=PAIRS)
    parser.add_argument("--shapes", nargs="*", default=["hull", "capsule"])
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args(arguments)
    around = surroundings(["pin", "coal", "numpy", "numba"])
    print_surroundings(around)
    print(
        f"{'':9}{'pairs':>6}{'step µs':>10}{'bare µs':>10}{'ratio':>8}{'99 %':>10}{'99.9 %':>10}"
        f"{'99.9/50 %':>12}{'steady':>8}{'resumed':>9}{'undisturbed':>12}{'grew kB':>10}{'gc':>6}"
        f"{'switches':>9}"
    )
    rows = []
    for shapes in options.shapes:
        for pairs in options.pairs:
            rows.append(measure(shapes, pairs, options.steps))
            print_row(rows[-1])
    if options.json:
        write_json(options.json, {"surroundings": around, "rows": rows})
    if options.figure:
        draw(rows, options.figure)


if __name__ == "__main__":
    main()
