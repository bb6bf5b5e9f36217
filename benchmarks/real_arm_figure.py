"""Draw what `real_arm.py` found of two laws that track: errors, and runs that touch something.

python benchmarks/real_arm_figure.py real_arm.json computed_torque.json real_arm.png
"""

import argparse
import json
from pathlib import Path

import numpy as np

from densarm.values.outcome import Outcome
from densarm.visualization.figure_style import BLUE, VERMILION, new_figure, save_figure

LABELS = {"tracking": "density", "computed_torque": "computed torque"}
BAR = 0.38  # of a row's height


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("results", nargs=2, type=Path, help="JSON that real_arm.py wrote")
    parser.add_argument("figure", type=Path)
    options = parser.parse_args()
    found = [json.loads(path.read_text(encoding="utf-8")) for path in options.results]
    cases = list(dict.fromkeys(run["case"] for run in found[0]["runs"]))
    rows = np.arange(len(cases))
    figure = new_figure(7.5, 0.28 * len(cases) + 1.3)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    for data, shift, colour in zip(found, (-0.5, 0.5), (BLUE, VERMILION), strict=True):
        of_case = [[run for run in data["runs"] if run["case"] == case] for case in cases]
        errors = [1e3 * np.median([run["error"] for run in runs]) for runs in of_case]
        hits = [[run["outcome"] == Outcome.COLLIDED for run in runs] for runs in of_case]
        label, at = LABELS[data["form"]], rows + shift * BAR
        left.barh(at, errors, BAR, color=colour, label=label)
        right.barh(at, [100.0 * np.mean(each) for each in hits], BAR, color=colour, label=label)
    left.set_yticks(rows, cases)
    left.set_xscale("log")
    left.set_xlabel("largest error of a joint, median of runs [mrad]")
    right.set_xlabel("runs that touch something [%]")
    right.set_xlim(0.0, 100.0)
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    left.set_ylim(len(cases) - 0.4, -0.6)
    for axes in (left, right):
        axes.grid(axis="x", alpha=0.3)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, options.figure)


if __name__ == "__main__":
    main()
