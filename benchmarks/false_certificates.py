"""Tamper with certified runs and count the false certificates.

Every run is made to fail one part of its certificate at least. A false certificate is one that all
parts hold of; a run that only left its tube is certified still, but not "within" one. Harmless by
design, so not tried: what the certificate does not read (the recorded clearance and outcome, the
last torque within the limits, names, seed and parameters of planning and control), wider limits,
fewer obstacles, an obstacle moved out of the way, a goal moved by less than what
counts as reached, and changes below the tolerances (1e-9 of start and replay).

    python benchmarks/false_certificates.py --runs 1000 --json false_certificates.json
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import cycle, islice
from pathlib import Path

import numpy as np
from tampering import KINDS, Kind, NotPossibleError

import densarm
from densarm import Run
from densarm.cli.output import write_json

Seed = int | tuple[int, int]

_ATTEMPTS = 60  # to find a run that can be made to fail in a given way


@dataclass
class Tally:
    """What came of the runs tampered with in one way."""

    runs: int = 0
    refused: int = 0
    """Not certified, or the file was refused."""
    as_meant: int = 0
    """Refused by the part that was aimed at."""
    false_certificates: list[str] = field(default_factory=list)


def tampered(
    kind: Kind, runs: Sequence[Run], rng: np.random.Generator
) -> Run | densarm.DensarmError | None:
    """Return a run made to fail, or the error by which its file was refused."""
    for _ in range(_ATTEMPTS):
        try:
            return kind.tamper(runs[int(rng.integers(len(runs)))], rng)
        except NotPossibleError:
            continue
        except densarm.DensarmError as error:
            return error
    return None


def judge(name: str, runs: Sequence[Run], seed: Seed, tally: Tally) -> None:
    """Tamper with a run in one way and count what its certificate says."""
    kind, rng = KINDS[name], np.random.default_rng(seed)
    result = tampered(kind, runs, rng)
    if result is None:
        return
    tally.runs += 1
    if isinstance(result, densarm.DensarmError):
        tally.refused += 1
        tally.as_meant += kind.part == "file"
        return
    certificate = result.certificate
    failing = {check.name for check in certificate.checks if not check.holds}
    is_claimed = certificate.certified and (kind.part != "tube" or bool(certificate.within))
    tally.refused += not is_claimed
    tally.as_meant += kind.part in failing
    if is_claimed:
        tally.false_certificates.append(f"{result.task.name}, seed {seed}")


def false_certificates(
    runs: Sequence[Run], count: int, seed: int = 0, parts: Sequence[str] = ()
) -> dict[str, Tally]:
    """Return a tally for each kind of tampering with certified runs, of some parts or all."""
    tallies = {name: Tally() for name, kind in KINDS.items() if not parts or kind.part in parts}
    for k, name in enumerate(islice(cycle(tallies), count)):
        judge(name, runs, (seed, k), tallies[name])
        if sys.stderr.isatty():
            print(f"\r{k + 1} of {count}", end="", file=sys.stderr)
    return tallies


def report(tallies: dict[str, Tally]) -> dict[str, int]:
    print(f"\n{'made to fail by':<28}{'part':<10}{'runs':>6}{'refused':>9}{'by it':>7}{'false':>7}")
    total: Counter[str] = Counter()
    for name, tally in tallies.items():
        counts = {
            "runs": tally.runs,
            "refused": tally.refused,
            "as_meant": tally.as_meant,
            "false": len(tally.false_certificates),
        }
        total.update(counts)
        runs, refused, as_meant, false = counts.values()
        print(f"{name:<28}{KINDS[name].part:<10}{runs:>6}{refused:>9}{as_meant:>7}{false:>7}")
    print(
        f"{'all':<38}{total['runs']:>6}{total['refused']:>9}{total['as_meant']:>7}{total['false']:>7}"
    )
    return dict(total)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--parts", nargs="+", default=(), help='to make fail, e.g. "tube"')
    parser.add_argument(
        "--scenarios", nargs="+", default=["swing_up", "panda_table", "panda_shelf"]
    )
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    runs = [densarm.run(name) for name in options.scenarios]
    for run in runs:
        if not run.certified:
            sys.exit(f"{run.task.name}: not certified to begin with")
    tallies = false_certificates(runs, options.runs, options.seed, options.parts)
    total = report(tallies)
    for name, tally in tallies.items():
        for where in tally.false_certificates:
            print(f"false certificate: {name}, {where}")
    if options.json:
        kinds = {name: vars(tally) for name, tally in tallies.items()}
        write_json(options.json, {"total": total, "kinds": kinds})
    return 1 if total["false"] else 0


if __name__ == "__main__":
    sys.exit(main())
