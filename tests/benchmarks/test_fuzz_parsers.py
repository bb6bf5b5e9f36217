"""The watch over parsers notes what they may not do."""

import json
import subprocess
import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SCRIPT = """
import json, pickle, sys, time
from pathlib import Path
from fuzzing.watch import Watch

class Loaded:
    def __reduce__(self):
        return (Path, ("x",))

def forbidden(folder):
    print("hello")
    (folder / "left.txt").write_text("x")
    pickle.loads(pickle.dumps(Loaded()))

folder = Path(sys.argv[1])
watch = Watch(folder, seconds=0.3, megabytes=512)
with watch.watching():
    pass
assert watch.notes == []
with watch.watching():
    forbidden(folder)
print(json.dumps(watch.notes), flush=True)
with watch.watching():
    while True:
        pass
"""


def test_the_watch(tmp_path: Path) -> None:
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        cwd=BENCHMARKS,
        env={"PYTHONPATH": str(BENCHMARKS)},
    )
    left = str(tmp_path / "left.txt")
    notes = json.loads(done.stdout)
    assert {f"opened {left} to write", "pickle.find_class", "printed", f"left {left}"} == set(notes)
    assert done.returncode == 1
    assert "Timeout" in done.stderr
