"""Draw what `densarm bench moving` found: contacts over the speed of the balls, by method.

    densarm bench moving --obstacles 4 --speed 1.5 --trials 200 --json moving_1.5.json
    python benchmarks/moving_figure.py moving_*.json --figure moving.png

Each file is a cell; a panel holds those that differ in speed alone. Bars are intervals of 95 %.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from densarm.values.proportion import Proportion
from densarm.visualization.figure_style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    new_figure,
    save_figure,
)

COLOURS = {
    "density": BLUE,
    "damper_qp": VERMILION,
    "stop_and_go": GREY,
    "plan_again": BLACK,
    "mink": ORANGE,
    "cbfpy": GREEN,
    "passive": PURPLE,
    "density_near": SKY,
}


def _panel(cell: dict[str, Any]) -> str:
    balls = "1 ball" if cell["obstacles"] == 1 else f"{cell['obstacles']} balls"
    words = [word for word in ("resting", "estimated") if cell[word]]
    return ", ".join([cell["arm"], balls, *words])


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("results", nargs="+", type=Path, help="JSON that the command wrote")
    parser.add_argument("--figure", type=Path, required=True)
    options = parser.parse_args(arguments)
    found = [json.loads(path.read_text(encoding="utf-8")) for path in options.results]
    found.sort(key=lambda data: float(data["cell"]["speed"]))
    names = sorted({_panel(data["cell"]) for data in found})
    figure = new_figure(2.6 * len(names) + 0.6, 3.0)
    panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
    drawn: dict[str, Any] = {}
    for axes, name in zip(panels, names, strict=True):
        cells = [data for data in found if _panel(data["cell"]) == name]
        methods = [m for m in COLOURS if any(m in data["methods"] for data in cells)]
        for k, method in enumerate(methods):
            some = [data for data in cells if method in data["methods"]]
            speeds = [data["cell"]["speed"] + 0.015 * (k - len(methods) // 2) for data in some]
            counts = [data["methods"][method] for data in some]
            shares = [100.0 * each["contacts"] / each["trials"] for each in counts]
            ends = [Proportion(each["contacts"], each["trials"]).interval for each in counts]
            low = [max(x - 100.0 * end[0], 0.0) for x, end in zip(shares, ends, strict=True)]
            high = [max(100.0 * end[1] - x, 0.0) for x, end in zip(shares, ends, strict=True)]
            drawn[method] = axes.errorbar(
                speeds, shares, (low, high), marker="o", ms=4, capsize=2, color=COLOURS[method]
            )
        axes.set_title(name)
        axes.set_xlabel("speed of the balls [m/s]")
        axes.grid(axis="y", alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylim(bottom=0.0)  # of all, once all is drawn
    panels[0].set_ylabel("trials with a contact [%]")
    figure.legend(drawn.values(), drawn, loc="outside upper center", ncols=len(drawn))
    save_figure(figure, options.figure)


if __name__ == "__main__":
    main()
