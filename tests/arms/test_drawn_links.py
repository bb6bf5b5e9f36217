"""Links that are drawn without collision geometry: who they are, and what they collide as."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.errors import InvalidValueError, RobotDescriptionError

DATA = Path(__file__).parents[1] / "data"
WHOLE = (DATA / "branching.urdf").read_text()
# Carriage and blade are drawn without collision geometry, base with; no other link is drawn.
TEXT = re.sub(r'(?s)(<link name="(?:carriage|blade)">.*?)<collision>.*?</collision>', r"\1", WHOLE)
LINES = (DATA / "meshes" / "wedge.obj").read_text().splitlines()
Corners = list[list[float]]
WEDGE: Corners = [[float(x) for x in line.split()[1:]] for line in LINES if line.startswith("v ")]


def description(which: str = "missing", text: str = TEXT) -> RobotDescription:
    folders = (str(DATA),)
    return RobotDescription("drawn", text, package_dirs=folders, collision_from_visual=which)


def shapes_of(arm: Arm) -> dict[str, list[Corners]]:
    """The corners of each link's shapes, of which only hulls have any."""
    shapes: dict[str, list[Corners]] = {}
    for item in arm.collision_model.geometryObjects:
        points = item.geometry.points().tolist() if hasattr(item.geometry, "points") else []
        shapes.setdefault(arm.model.frames[item.parentFrame].name, []).append(points)
    return shapes


def is_wedge(shapes: list[Corners]) -> bool:
    points = shapes[0]
    return len(points) == len(WEDGE) and np.allclose(sorted(points), sorted(WEDGE))


@pytest.mark.parametrize(
    ("which", "absent", "drawn"),
    [
        ("never", {"carriage", "blade"}, set()),
        ("missing", set(), {"carriage", "blade"}),
        ("always", set(), {"base", "carriage", "blade"}),
    ],
)
def test_which_links_collide_as_drawn(which: str, absent: set[str], drawn: set[str]) -> None:
    arm, before = Arm(description(which)), shapes_of(Arm(description(text=WHOLE)))
    assert arm.links_without_collision == ("carriage", "blade")
    shapes = shapes_of(arm)
    assert before.keys() - shapes.keys() == absent
    assert {link for link in shapes if is_wedge(shapes[link])} == drawn
    for link in shapes.keys() - drawn:
        assert shapes[link] == before[link]


def test_they_are_paired_hashed_drawn_and_recorded_like_others() -> None:
    arm = Arm(description())
    assert set(arm.mesh_hashes()) == {"wedge.obj"}
    named = {frozenset(pair.shapes) for pair in arm.excluded_pairs}
    items = list(arm.collision_model.geometryObjects)
    named |= {
        frozenset((items[pair.first].name, items[pair.second].name))
        for pair in arm.collision_model.collisionPairs
    }
    assert frozenset(("base_0", "blade_0")) in named
    assert arm.visual_model.ngeoms == 3
    again = RobotDescription.from_json(arm.description.to_json())
    assert Arm(again).collision_model.ngeoms == arm.collision_model.ngeoms


def test_earlier_records_keep_the_shapes_that_they_were_made_with() -> None:
    data = description().to_json()
    del data["collision_from_visual"]
    assert RobotDescription.from_json(data) == description("never")


@pytest.mark.parametrize(
    "change", [("wedge.obj", "gone.obj"), ('wedge.obj"', 'wedge.obj" scale="1 1 1e9"')]
)
def test_a_visual_mesh_that_cannot_collide(change: tuple[str, str]) -> None:
    bad = replace(description(), urdf=TEXT.replace(*change))
    with pytest.raises(RobotDescriptionError, match=r"of link 'carriage'.*='never' leaves it out"):
        Arm(bad)
    assert Arm(replace(bad, collision_from_visual="never")).nv == 5


def test_choice_by_load_arm(tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text(TEXT)
    assert "blade" in shapes_of(load_arm(file, package_dirs=[DATA]))
    arm = load_arm(file, package_dirs=[DATA], collision_from_visual="never")
    assert "blade" not in shapes_of(arm)
    with pytest.raises(InvalidValueError, match=r"collision_from_visual.*'often'.*always, missing"):
        load_arm(file, package_dirs=[DATA], collision_from_visual="often")
