"""Feed densarm's parsers broken files: a result, or a DensarmError of one line, and nothing else.

Scenario TOML, run .npz, MotionBenchMaker problems, URDF, SRDF, MoveIt .scene and YAML, and meshes
in DAE and STL, are mutated from real files and from nested random values by hypothesis. A failure
is any other exception, a message of several lines, a warning or output, an example that takes too
long or kills the process, a file written or left, a pickle, another process, or more than 1 GB of
memory.

    python benchmarks/fuzz_parsers.py --minutes 5 --json fuzz_parsers.json
"""

import argparse
import json
import subprocess
import sys
import time
import traceback
import warnings
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from fuzzing import mutations
from fuzzing.targets import NAMES, targets
from fuzzing.watch import Watch
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

import densarm
from densarm.cli.output import write_json

_SECONDS = 20.0  # that an example may take, on a busy machine
_MEGABYTES = 1024
_BATCH = 100  # examples between two looks at the clock


class Campaign:
    """Examples of one parser and what went wrong with them.

    Args:
        name: of the target.
        folder: to work in.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self._target = targets(folder)[name]
        self._path = folder / f"input{self._target.suffix}"
        for content in self._target.seeds:  # imports and compiles what parsing needs
            self._path.write_bytes(content)
            self._target.parse(self._path)
        self._watch = Watch(folder, _SECONDS, _MEGABYTES)
        self.parsed = self.refused = 0
        self.failures: dict[str, dict[str, object]] = {}

    def run(self, minutes: float, first_seed: int) -> None:
        """Try examples until time is up."""
        end = time.monotonic() + 60.0 * minutes
        while time.monotonic() < end:
            self._batch(first_seed, end)
            first_seed += 1

    def _batch(self, number: int, end: float) -> None:
        @seed(number)
        @settings(
            max_examples=_BATCH,
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(st.data(), st.randoms(use_true_random=False), st.sampled_from(self._target.seeds))
        def each(data: st.DataObject, random: Random, content: bytes) -> None:
            try:
                example = self._example(data, random, content)
            except (ArithmeticError, LookupError, TypeError, ValueError):
                return  # no such file can be made
            if time.monotonic() < end:
                self.try_example(example)

        each()

    def _example(self, data: st.DataObject, random: Random, content: bytes) -> bytes:
        kind = random.random()
        if kind < 0.6:
            return self._target.mutate(content, random, data.draw)
        mutate = mutations.mutated_text if kind < 0.8 else mutations.mutated_bytes
        return mutate(content, random)

    def try_example(self, content: bytes) -> None:
        """Parse a file's content and note what went wrong."""
        self._path.write_bytes(content)
        wrong, trace = "", ""
        try:
            with self._watch.watching():
                try:
                    self._target.parse(self._path)
                    self.parsed += 1
                except densarm.DensarmError as error:
                    self.refused += 1
                    if "\n" in str(error) or not str(error):
                        wrong = f"message of several lines: {error!r}"[:200]
        except BaseException as error:  # noqa: BLE001 -- whatever it is, it is what is looked for
            trace = traceback.format_exc()[-3000:]
            place = traceback.extract_tb(error.__traceback__)[-1]
            wrong = f"{type(error).__name__} in {Path(place.filename).name}:{place.lineno}"
        for note in filter(None, [wrong, *self._watch.notes]):
            known = self.failures.get(note)
            if known is None or len(content) < len(bytes.fromhex(str(known["input"]))):
                self.failures[note] = {"input": content.hex(), "traceback": trace}


def child(name: str, minutes: float, first_seed: int, folder: Path) -> None:
    """Run one campaign in this process and print its result."""
    warnings.simplefilter("error")
    campaign = Campaign(name, folder)
    campaign.run(minutes, first_seed)
    counts = {"parsed": campaign.parsed, "refused": campaign.refused}
    print(json.dumps({**counts, "failures": campaign.failures}))


def supervised(name: str, minutes: float, first_seed: int) -> dict[str, Any]:
    """Run one campaign in a process of its own, and note if it hangs or dies."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, __file__, "--child", name, "--folder", folder]
        command += ["--minutes", str(minutes), "--seed", str(first_seed)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return dict(json.loads(done.stdout.splitlines()[-1]))
        inputs = [path.read_bytes().hex() for path in Path(folder).glob("input.*")]
        failure = {"input": "".join(inputs), "traceback": done.stderr[-3000:]}
        return {"parsed": 0, "refused": 0, "failures": {f"ended with {done.returncode}": failure}}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=5.0, help="for each parser")
    parser.add_argument("--parsers", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--child", choices=NAMES, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.child, options.minutes, options.seed, options.folder)
        return 0
    results = {}
    print(f"{'parser':<12}{'examples':>10}{'parsed':>8}{'refused':>9}{'failures':>10}")
    for name in options.parsers:
        result = results[name] = supervised(name, options.minutes, options.seed)
        parsed, refused, failures = result["parsed"], result["refused"], result["failures"]
        print(f"{name:<12}{parsed + refused:>10}{parsed:>8}{refused:>9}{len(failures):>10}")
        for what, failure in failures.items():
            print(f"  {what}\n    {bytes.fromhex(failure['input'])[:200]!r}")
    if options.json:
        write_json(options.json, results)
    return 1 if any(result["failures"] for result in results.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
