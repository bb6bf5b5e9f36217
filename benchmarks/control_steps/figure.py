"""A picture of the comparison."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

_MEASURE, _COMMAND = "#9db8d2", "#1f4e79"
_BAR = 0.38  # of the row's height


def draw(comparison: dict[str, Any], file: Path) -> None:
    """Draw one task's medians, whiskers from the 5th to the 95th percentile, as bars."""
    steps = comparison["steps"]
    with mpl.rc_context({"font.size": 10}):
        figure = Figure(figsize=(8.0, 0.62 * len(steps) + 1.5), layout="constrained")
        axes = figure.subplots()
        rows = range(len(steps))
        for key, shift, color, label in (
            ("measure_us", -0.5, _MEASURE, "distances and gradients alone"),
            ("command_us", 0.5, _COMMAND, "whole command"),
        ):
            spreads = [step[key] for step in steps]
            medians = [s["median"] for s in spreads]
            whiskers = [
                [s["median"] - s["p5"] for s in spreads],
                [s["p95"] - s["median"] for s in spreads],
            ]
            at = [row + shift * _BAR for row in rows]
            axes.barh(at, medians, _BAR, xerr=whiskers, color=color, label=label, ecolor="0.45")
            for y, spread in zip(at, spreads, strict=True):
                axes.text(spread["p95"] * 1.12, y, _time(spread["median"]), va="center", size=9)
        axes.set_yticks(rows, [step["name"] for step in steps])
        axes.invert_yaxis()
        axes.set_xscale("log")
        axes.set_xlim(right=axes.get_xlim()[1] * 2.5)
        axes.set_xlabel("CPU time of one control step [µs]")
        axes.set_title(
            f"Panda ({comparison['shapes']}s), {comparison['spheres']} {comparison['scene']}"
            f" spheres, {comparison['pairs']} pairs",
            size=11,
        )
        axes.grid(axis="x", alpha=0.3)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        axes.legend(loc="upper right")
        figure.savefig(file, dpi=150)


def _time(microseconds: float) -> str:
    if microseconds < 1000.0:
        return f"{microseconds:.0f} µs"
    return f"{microseconds / 1000.0:.1f} ms"
