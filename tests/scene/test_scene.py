"""Scenes and attachments: checked when made, and their JSON form."""

import json
from typing import Any

import numpy as np
import pytest

from densarm.errors import DensarmError, InvalidValueError
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Attachment, Scene


def test_json_takes_numpy_numbers() -> None:
    half: Any = np.float32(0.5)
    scene = Scene(
        [
            Sphere(name="a", radius=half, position=np.zeros(3)),
            Box(name="b", size=np.arange(1, 4), position=[1, 2, 3]),
        ]
    )
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene
    box = scene.obstacles[1]
    assert isinstance(box, Box)
    assert box.size == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([{"type": "ball", "name": "a"}], r"unknown type of obstacle a 'ball'.*known: box, caps"),
        ([{"name": "a"}], "unknown type of obstacle a 'None'"),
        ([{"type": ["box"], "name": "a"}], "unknown type of obstacle a"),
        ([{"type": "box", "name": "a"}], r"obstacle a.size = None: must be given for a box"),
        ([{"type": "sphere", "radius": 1}], "name = None: must be given"),
        (
            [{"type": "sphere", "name": "a", "radius": 1, "colour": "red"}],
            r"unknown key of obstacle a \(sphere\) 'colour'.*known: motion, name, orientation",
        ),
        (["box"], "obstacle = 'box': must be a table"),
        ([{"type": "sphere", "name": "a", "radius": 1}] * 2, "obstacle name = 'a': must be used"),
    ],
)
def test_wrong_json(entries: Any, message: str) -> None:
    with pytest.raises(DensarmError, match=message):
        Scene.from_json(entries)


def test_scene_takes_obstacles_alone() -> None:
    ball: Any = ["ball"]
    with pytest.raises(InvalidValueError, match="one of Sphere, Box, Capsule, Cylinder"):
        Scene(ball)
    assert len(Scene()) == 0


BAR = Attachment(Box(name="bar", size=[0.1, 0.1, 0.5]), "hand", ["link2"], 0.5)


def test_json_of_attachments() -> None:
    scene = Scene([Sphere(name="ball", radius=0.1)], [BAR])
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene
    assert hash(scene) == hash(Scene(scene, scene.attachments))
    assert BAR.touch_links == ("link2",)


def test_attached_bodies_have_names_of_their_own() -> None:
    ball = Sphere(name="ball", radius=0.1)
    with pytest.raises(InvalidValueError, match="obstacle name = 'ball': must be used only once"):
        Scene([ball], [Attachment(ball, "hand")])


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"touch_links": "link1"}, "bar.touch_links = 'link1': must be a list of names"),
        ({"touch_links": [3]}, r"bar.touch_links = \[3\]: must be a list of names"),
        ({"mass": -1}, "bar.mass = -1: must be a finite number >= 0"),
        ({"attached_to": 3}, "bar.attached_to = 3: must be the name of a link"),
        ({"type": "half_space"}, "attached body = .*must be one of Sphere, Box"),
        ({"colour": "red"}, r"unknown key of obstacle bar \(sphere\) 'colour'"),
        ({"radius": 0}, "bar.radius = 0: must be a finite number > 0"),
    ],
)
def test_wrong_attachments(table: dict[str, Any], message: str) -> None:
    whole = {"type": "sphere", "name": "bar", "radius": 0.1, "attached_to": "hand", **table}
    if whole["type"] == "half_space":
        del whole["radius"]
    with pytest.raises(DensarmError, match=message) as caught:
        Scene.from_json([whole])
    assert "\n" not in str(caught.value)
