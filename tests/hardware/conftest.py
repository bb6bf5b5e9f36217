import pytest

from densarm.arms.arm import load_arm
from densarm.scene.obstacles import Box
from densarm.scene.scene import Scene
from densarm.world.world import World


@pytest.fixture(scope="session")
def posts() -> World:
    """FR3 before a post on a table."""
    post = Box(name="post", size=[0.06, 0.06, 0.4], position=[0.55, 0.0, 0.22])
    board = Box(name="table", size=[0.6, 1.2, 0.04], position=[0.6, 0.0, 0.0])
    return World(load_arm("fr3"), Scene([board, post]))
