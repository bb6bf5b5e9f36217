"""Broken URDFs: an arm that works, or one line that says what is wrong; never anything else."""

import random
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.errors import DensarmError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.world.world import World

DATA = Path(__file__).parents[1] / "data"
TEXT = (DATA / "branching.urdf").read_text()
SCENE = Scene([Sphere(name="ball", radius=0.1, position=(0.4, 0.1, 0.5))])

NUMBERS = ("nan", "inf", "-1", "0", "1e308", "-1e308", "1e-308", "1e30", "", "x", "0x10", "1,5")
KINDS = ("prismatic", "floating", "planar", "fixed", "revolute", "continuous", "spherical")
NAMES = ("", "base", "blade", "turn", "world", "universe", "root_joint", "é", "a\nb", "x" * 5000)
PATHS = ("meshes/wedge.obj", "package://", "file:///", "meshes", "\0", "../branching.srdf")
VECTORS = ("0 0", "nan nan nan", "0 0 0 0", "1e200 1 1", "-1 -1 -1", "0 0 0", "1e-9 1 1")
TAGS: tuple[str, ...]
TAGS = ("link", "joint", "mesh", "box", "sphere", "capsule", "mimic", "inertial", "collision")
TAGS += ("origin", "robot", "limit", "transmission", "axis", "visual", "geometry")


def parents(root: Element) -> list[Element]:
    return [element for element in root.iter() if len(element)]


def attributes(root: Element) -> list[tuple[Element, str]]:
    return [(element, key) for element in root.iter() for key in sorted(element.attrib)]


def drop_element(root: Element, choice: random.Random) -> None:
    parent = choice.choice(parents(root))
    parent.remove(choice.choice(list(parent)))


def copy_element(root: Element, choice: random.Random) -> None:
    child = choice.choice(list(choice.choice(parents(root))))
    copied = ElementTree.fromstring(ElementTree.tostring(child))
    choice.choice(list(root.iter())).append(copied)


def rename_element(root: Element, choice: random.Random) -> None:
    choice.choice(list(root.iter())).tag = choice.choice(TAGS)


def add_mimic(root: Element, choice: random.Random) -> None:
    joint = choice.choice(list(root.findall("joint")) or [root])
    numbers = {key: choice.choice((*NUMBERS, "2")) for key in ("multiplier", "offset")}
    leader = choice.choice((*NAMES, "left", "wrist"))
    joint.append(Element("mimic", {"joint": leader, **numbers}))


def drop_attribute(root: Element, choice: random.Random) -> None:
    element, key = choice.choice(attributes(root))
    del element.attrib[key]


def change_value(root: Element, choice: random.Random) -> None:
    element, key = choice.choice(attributes(root))
    element.set(key, choice.choice(KINDS + NAMES + PATHS + VECTORS))


def change_number(root: Element, choice: random.Random) -> None:
    element, key = choice.choice(attributes(root))
    parts = element.attrib[key].split() or [""]
    parts[choice.randrange(len(parts))] = choice.choice(NUMBERS)
    element.set(key, " ".join(parts))


def exchange_values(root: Element, choice: random.Random) -> None:
    wanted = choice.choice(("name", "link", "xyz", "filename", "type"))
    holders = [element for element, key in attributes(root) if key == wanted] or [root]
    choice.choice(holders).set(wanted, choice.choice(holders).get(wanted, ""))


MUTATIONS = (
    drop_element,
    copy_element,
    rename_element,
    add_mimic,
    drop_attribute,
    change_value,
    change_number,
    exchange_values,
)


def mutant(seed: int) -> str:
    choice = random.Random(seed)
    root = ElementTree.fromstring(TEXT)
    for _ in range(choice.randint(1, 3)):
        choice.choice(MUTATIONS)(root, choice)
    text = ElementTree.tostring(root, encoding="unicode")
    return text if choice.random() < 0.95 else text[: choice.randrange(len(text))]


def arm_or_reason(text: str) -> Arm | str:
    description = RobotDescription(name="mutant", urdf=text, package_dirs=(str(DATA),))
    try:
        return Arm(description)
    except DensarmError as error:
        return str(error)


# A seed stands for its mutant: of a broken file the smallest example would say no more.
@pytest.mark.slow
@settings(max_examples=120, derandomize=True, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**32))
def test_mutants_work_or_are_refused_in_one_line(
    capfd: pytest.CaptureFixture[str], seed: int
) -> None:
    result = arm_or_reason(mutant(seed))
    if isinstance(result, str):
        assert result
        assert "\n" not in result
    else:
        q = result.configuration(np.zeros(result.nv))
        sample = World(result, SCENE).clearance(q)
        assert np.isfinite(sample.distance).all()
        assert np.isfinite(sample.gradient).all()
        if not result.links_without_mass:
            assert np.linalg.eigvalsh(result.mass_matrix(q)).min() > 0.0
            assert np.isfinite(result.nonlinear_effects(q, np.ones(result.nv))).all()
    assert capfd.readouterr() == ("", "")


def test_mutants_are_of_both_kinds() -> None:
    results = [arm_or_reason(mutant(seed)) for seed in range(30)]
    assert 5 < sum(isinstance(result, Arm) for result in results) < 25
