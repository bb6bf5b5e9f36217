import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from densarm.cli import main
from densarm.scenarios.scenario import load_scenario

BENCHMARKS = ("bench step", "bench random", "bench motionbenchmaker")
README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)


def commands(block: str) -> list[str]:
    steps = [step.strip() for step in re.split(r"&&|\n", block)]
    return [step for step in steps if step.startswith("densarm ")]


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("readme"))
        yield


def test_fresh_machine_takes_two_commands() -> None:
    assert "pip install . && densarm run swing_up --html swing_up.html\n" in blocks("sh")
    assert "pip install '.[test]' && pytest -n auto\n" in blocks("sh")


@pytest.mark.slow
@pytest.mark.parametrize("block", [block for block in blocks("sh") if commands(block)])
def test_commands(block: str) -> None:
    for command in commands(block):
        arguments = shlex.split(command, comments=True)[1:]
        assert main(arguments) == 0, command


@pytest.mark.slow
def test_python(capsys: pytest.CaptureFixture[str]) -> None:
    (program,) = blocks("python")
    assert sum(bool(line.strip()) for line in program.splitlines()) <= 10
    exec(compile(program, "README.md", "exec"), {})
    assert "certified: True" in capsys.readouterr().out
    assert Path("panda_shelf.gif").is_file()


def test_scenario_file() -> None:
    (text,) = blocks("toml")
    Path("reach.toml").write_text(text, encoding="utf-8")
    scenario = load_scenario("reach.toml")
    assert scenario.title == "Reach over a box"
    assert main(["run", "reach.toml"]) == 0


def test_every_command_is_in_the_table() -> None:
    for name in ("list", "run", "view", "verify", "compare", *BENCHMARKS):
        assert f"| `densarm {name}" in README
