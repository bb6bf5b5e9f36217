"""Run every scenario of the catalogue as a whole process and print how each ended.

    python benchmarks/scenarios.py [SCENARIO ...] [--seed 0]

The time is that of the process, from its start to its exit. The exit status is 1 if a scenario
does not end reached and certified.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from densarm.arms.catalogue import scenario_paths


def run(name: str, seed: int, file: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "densarm", "run", name, "--seed", str(seed)]
    began = time.perf_counter()
    command += ["--json", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    summary = json.loads(file.read_text()) if file.is_file() else {"outcome": done.stderr.strip()}
    return {"time_s": time.perf_counter() - began, "certified": False, **summary}


def number(value: float | None, scale: float = 1.0) -> str:
    return "-" if value is None else f"{scale * value:.2f}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenarios", nargs="*", default=list(scenario_paths()))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(f"{'scenario':<20}{'outcome':<12}certified  motion [s]  clearance [mm]  process [s]")
    proved = True
    for name in options.scenarios:
        with tempfile.TemporaryDirectory() as folder:
            result = run(name, options.seed, Path(folder) / "run.json")
        certified = "yes" if result["certified"] else "no"
        motion, clearance = result.get("duration_s"), result.get("min_clearance_m")
        print(
            f"{name:<20}{result['outcome']:<12}{certified:>9}{number(motion):>12}"
            f"{number(clearance, 1e3):>16}{result['time_s']:>13.1f}",
            flush=True,
        )
        proved = proved and result["certified"] and result["outcome"] == "reached"
    return 0 if proved else 1


if __name__ == "__main__":
    sys.exit(main())
