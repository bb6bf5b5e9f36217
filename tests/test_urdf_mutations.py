"""Broken URDFs: an arm that works, or one line that says what is wrong; never anything else."""

import os
import random
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from densarm.arm import Arm
from densarm.clearance import Clearance
from densarm.errors import DensarmError
from densarm.robot_description import RobotDescription
from densarm.scene import Scene, Sphere

DATA = Path(__file__).parent / "data"
TEXT = (DATA / "branching.urdf").read_text()
SCENE = Scene([Sphere(name="ball", radius=0.1, position=(0.4, 0.1, 0.5))])

NUMBERS = (
    "nan",
    "inf",
    "-1",
    "0",
    "1e308",
    "-1e308",
    "1e-308",
    "1e30",
    "",
    "x",
    "0x10",
    "1,5",
    "٣",
)
WORDS = (
    "",
    "base",
    "blade",
    "turn",
    "world",
    "universe",
    "prismatic",
    "floating",
    "planar",
    "fixed",
    "revolute",
    "continuous",
    "spherical",
    "meshes/wedge.obj",
    "package://",
    "file:///",
    "a\nb",
    "é",
    "x" * 5000,
    "0 0",
    "nan nan nan",
    "0 0 0 0",
    "1e200 1 1",
    "-1 -1 -1",
)
TAGS = (
    "link",
    "joint",
    "mesh",
    "box",
    "sphere",
    "capsule",
    "mimic",
    "inertial",
    "collision",
    "origin",
    "robot",
    "limit",
    "transmission",
    "axis",
)


Mutation = Callable[[ElementTree.Element, random.Random], None]


def elements(root):
    return list(root.iter())


def drop_element(root, choice):
    parent = choice.choice([e for e in root.iter() if len(e)])
    parent.remove(choice.choice(list(parent)))


def double_element(root, choice):
    parent = choice.choice([e for e in root.iter() if len(e)])
    parent.append(choice.choice(list(parent)))


def move_element(root, choice):
    parent = choice.choice([e for e in root.iter() if len(e)])
    child = choice.choice(list(parent))
    choice.choice(elements(root)).append(ElementTree.fromstring(ElementTree.tostring(child)))


def drop_attribute(root, choice):
    element = choice.choice([e for e in root.iter() if e.attrib])
    del element.attrib[choice.choice(sorted(element.attrib))]


def change_word(root, choice):
    element = choice.choice([e for e in root.iter() if e.attrib])
    element.set(choice.choice(sorted(element.attrib)), choice.choice(WORDS))


def change_number(root, choice):
    element = choice.choice([e for e in root.iter() if e.attrib])
    key = choice.choice(sorted(element.attrib))
    parts = element.get(key).split() or [""]
    parts[choice.randrange(len(parts))] = choice.choice(NUMBERS)
    element.set(key, " ".join(parts))


def swap_values(root, choice):
    key = choice.choice(["name", "link", "xyz", "filename", "type", "joint"])
    holders = [e for e in root.iter() if key in e.attrib] or [root]
    first, second = choice.choice(holders), choice.choice(holders)
    first.set(key, second.get(key, ""))


def rename_tag(root, choice):
    choice.choice(elements(root)).tag = choice.choice(TAGS)


MUTATIONS = (
    drop_element,
    double_element,
    move_element,
    drop_attribute,
    change_word,
    change_number,
    change_number,
    swap_values,
    rename_tag,
)


def load(text: str) -> Arm | None:
    try:
        arm = Arm(RobotDescription(name="mutant", urdf=text, package_dirs=(str(DATA),)))
        clearance = Clearance(arm, SCENE)
    except DensarmError as error:
        assert str(error)
        assert "\n" not in str(error)
        return None
    sample = clearance.evaluate(arm.postures["neutral"])
    assert np.isfinite(sample.distance).all(), sample.distance
    assert np.isfinite(sample.gradient).all()
    assert np.isfinite(arm.mass_matrix(arm.postures["neutral"])).all()
    assert np.isfinite(arm.nonlinear_effects(arm.postures["neutral"], np.zeros(arm.nv))).all()
    return arm
