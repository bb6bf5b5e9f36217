"""Load every URDF of a folder as it is, and print a Markdown table of what came of each.

    python benchmarks/foreign_urdfs.py [FOLDER]

The folder is that of example-robot-data unless another is given. No joint is locked and no SRDF
read. The exit status is 1 if anything but a `DensarmError` of one line was raised.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from densarm.arms.arm import load_arm
from densarm.arms.description import DATA_WHEEL, data_wheel_folder
from densarm.errors import DensarmError

_WIDTH = 200  # characters of a reason


def row(path: Path, folder: Path) -> tuple[str, str, str]:
    """Return what came of a URDF, its joints and its self-collision pairs."""
    try:
        arm = load_arm(path)
    except DensarmError as error:
        reason = str(error).replace(str(folder), folder.name)
        if "\n" in reason:
            raise
        return f"refused: {reason[:_WIDTH]}{'...' * (len(reason) > _WIDTH)}", "", ""
    told = "".join(f"; {remark}" for remark in arm.remarks)
    return f"loads{told}", str(arm.nv), str(len(arm.collision_model.collisionPairs))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    folder = data_wheel_folder() / DATA_WHEEL / "robots"
    parser.add_argument("folder", nargs="?", type=Path, default=folder)
    folder = parser.parse_args(arguments).folder
    results = []
    print("| URDF | result | joints | pairs |\n|---|---|---|---|")
    for path in sorted(folder.rglob("*.urdf")):
        try:
            cells = row(path, folder)
        except Exception as error:  # noqa: BLE001 - what is looked for
            cells = f"broken: {type(error).__name__}", "", ""
        results.append(cells[0].split(":")[0].split(";")[0])
        print(f"| {path.relative_to(folder)} | {' | '.join(cells)} |", flush=True)
    counts = ", ".join(f"{results.count(kind)} {kind}" for kind in sorted(set(results)))
    print(f"\nOf {len(results)}: {counts}.")
    return 1 if "broken" in results else 0


if __name__ == "__main__":
    sys.exit(main())
