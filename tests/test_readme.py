"""What README and docs show runs as it stands there, and what they link to exists."""

import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import pytest

import densarm
from densarm.cli import main
from densarm.cli.application import application
from densarm.scenarios.scenario import load_scenario
from densarm.simulation.run import Run

ROOT = Path(__file__).parents[1]
README, COMMANDS = ROOT / "README.md", ROOT / "docs" / "commands.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]

MADE = re.compile(r"(keys|reference/\w+)\.md$")
"""Pages that the site alone has; `mkdocs build --strict` checks links to them."""


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", text_of(page), re.DOTALL | re.MULTILINE)
    return [str(block) for block in found]


def commands(block: str) -> list[str]:
    steps = [step.strip() for step in re.split(r"&&|\n", block)]
    return [step for step in steps if step.startswith("densarm ")]


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", text_of(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("readme"))
        yield


def test_fresh_machine_takes_two_commands() -> None:
    assert "pip install . && densarm run swing_up --html swing_up.html\n" in blocks(README, "sh")
    assert "pip install '.[test]' && pytest -n auto\n" in blocks(README, "sh")


def test_readme_is_read_in_a_minute() -> None:
    assert len(text_of(README).splitlines()) <= 130
    first = blocks(README, "python")[0]
    assert sum(bool(line.strip()) for line in first.splitlines()) <= 10


@pytest.mark.slow
@pytest.mark.parametrize("page", [README, COMMANDS], ids=lambda page: page.name)
def test_commands(page: Path) -> None:
    for block in blocks(page, "sh"):
        for command in commands(block):
            arguments = shlex.split(command, comments=True)[1:]
            assert main(arguments) == 0, command


@pytest.mark.slow
def test_commands_in_the_text_of_the_readme() -> None:
    (command,) = re.findall(r"`(densarm plan [^`]+)`", text_of(README))
    assert main(shlex.split(command)[1:]) == 0


@pytest.mark.slow
def test_python(
    catalogue_run: Callable[[str], Run],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One block after the other, as somebody would type them."""

    def run(name: str, **options: Any) -> Run:
        return as_it_is(name, **options) if options else catalogue_run(name)

    as_it_is = densarm.run
    monkeypatch.setattr(densarm, "run", run)
    names: dict[str, object] = {}
    for k, program in enumerate(blocks(README, "python")):
        exec(compile(program, f"README.md, block {k + 1}", "exec"), names)
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "The arm reached the goal, held it and touched nothing. certified: True"
    assert out[1] == "The arm reached the goal, held it and touched nothing."
    assert out[2:] == ["reached"] * 3
    assert Path("panda_shared_table.html").is_file()


def test_scenario_file() -> None:
    (text,) = blocks(COMMANDS, "toml")
    Path("reach.toml").write_text(text, encoding="utf-8")
    scenario = load_scenario("reach.toml")
    assert scenario.title == "Reach over a box"
    assert main(["run", "reach.toml"]) == 0


def test_every_command_is_in_the_table() -> None:
    def ends(group: click.Group, before: str) -> Iterator[str]:
        for name, command in group.commands.items():
            if isinstance(command, click.Group):
                yield from ends(command, f"{before} {name}")
            else:
                yield f"{before} {name}"

    for name in ends(application(), "densarm"):
        assert re.search(rf"^\| `{name}\b", text_of(COMMANDS), flags=re.MULTILINE), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", text_of(page)):
        target, _, anchor = link.partition("#")
        if target.startswith("http") or MADE.match(target):
            continue
        path = page.parent / target if target else page
        assert path.exists(), link
        assert not anchor or anchor in anchors(path), link
