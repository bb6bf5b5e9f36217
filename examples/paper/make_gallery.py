"""Run every script of this folder and write docs/gallery.md with the pictures and verdicts."""

import argparse
import json
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
DOCS = FOLDER.parents[1] / "docs"

BEYOND = """\
Where a figure departs from the paper, or chooses what that leaves open, is told with it, in its
picture and in its result.json. What the library itself does otherwise is in
[Departures from \\[ZNV\\]](departures.md).

Beyond the figures, the nearest statements that hold:

- Assumptions: distances hold but for r = 2.5 in Fig. 5, whose region does not enclose the C. As
  written, with every |∂V/∂x_j| above 0, Assumption 2 holds in no workspace around the target; the
  proof needs ‖∇V‖ > 0 alone. Of 100 starts outside the sensing regions in each scene none enters
  at θ = 0.01, 0.1 or 1. Some of those inside, close to a set, do at each of these, and stay for
  times that grow as θ falls, where the bound falls; at θ = 0 none enters.
- Moving scene: of 1,000 starts none is met by obstacles at up to 0.9 u_max, 1 at 1.25, 82 at 2 and
  247 at 3 times u_max; single points are pushed ahead of an obstacle for seconds before they track.
- Rantzer's condition: without obstacles it holds from α = (n − 2)/4 (density), (n − 2)/2 (log) and
  for n ≤ 2 (reciprocal). For θ = 0 it fails at the saddle behind the obstacle, at every α tried (to
  1,000). For θ > 0 it holds everywhere once α is so large that starts run through the obstacle.
  Convergence does not need it: at θ = 0, α = 1 all starts of Fig. 3 reach.
"""


def section(script: Path, pictures: Path) -> str:
    """Text on one figure whose script has run."""
    result = json.loads((pictures / "result.json").read_text(encoding="utf-8"))
    verdict = "The claim holds." if result["holds"] else "The claim does not hold."
    images = "\n".join(
        f"![{result['figure']}]({picture.relative_to(DOCS).as_posix()})"
        for picture in sorted(pictures.glob("*.png"))
    )
    departures = "".join(f"- {each}\n" for each in result["departures"])
    numbers = (pictures / "result.json").relative_to(DOCS).as_posix()
    return (
        f"## {result['figure']}\n\n{images}\n\n{result['claim']} **{verdict}**\n"
        f"Numbers: [result.json]({numbers}). Script: `examples/paper/{script.name}`.\n"
        + (f"\nDepartures from the paper:\n\n{departures}" if departures else "")
    )


def scripts() -> list[Path]:
    """Scripts of the paper's figures, in their order, then those beyond it."""
    others = {Path(__file__).stem, "paper_figure"}
    found = sorted(path for path in FOLDER.glob("*.py") if path.stem not in others)
    return sorted(found, key=lambda path: not path.stem.startswith("fig"))


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", action="store_true", help="do not run scripts that have run")
    options = parser.parse_args(arguments)
    sections = []
    for script in scripts():
        pictures = DOCS / "gallery" / script.stem
        if not (options.keep and (pictures / "result.json").exists()):
            subprocess.run([sys.executable, script, "--out", pictures], check=True)
        sections.append(section(script, pictures))
    introduction = (
        "# Gallery\n\nThe figures of A. Zheng, S. S. K. S. Narayanan, U. Vaidya, *Safe Navigation "
        "Using Density Functions*, IEEE RA-L 2023, each with its claim and whether it held.\n"
        "`python examples/paper/make_gallery.py` makes this page.\n\n" + BEYOND + "\n"
    )
    (DOCS / "gallery.md").write_text(introduction + "\n".join(sections), encoding="utf-8")


if __name__ == "__main__":
    main()
