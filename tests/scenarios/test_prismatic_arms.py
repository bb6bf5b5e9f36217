"""Arms of slides alone, from the URDF to the certificate."""

from pathlib import Path

import numpy as np

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.certificate import swept_result
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.outcome import Outcome
from densarm.world.swept_check import SweptVerdict

GANTRY = Path(__file__).parents[1] / "data" / "gantry.urdf"
SLIDER = """<robot name="slider">
  <link name="rail"/>
  <link name="car">
    <inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <joint name="slide" type="prismatic">
    <parent link="rail"/><child link="car"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="50" velocity="1"/>
  </joint>
</robot>"""


def scenario(arm: Arm, obstacle: Obstacle, start: list[float], goal: list[float]) -> Scenario:
    return Scenario(
        name="slides",
        title="Slides",
        arm=arm,
        scene=Scene([obstacle]),
        start=np.array(start),
        goal=np.array(goal),
    )


def test_gantry_lifts_its_tool_over_a_wall() -> None:
    wall = Box(name="wall", size=(0.1, 1.2, 0.3), position=(0.0, 0.0, 0.15))
    over_it = scenario(load_arm(GANTRY), wall, [-0.7, 0.0, 0.45], [0.7, 0.2, 0.45])
    done = run(over_it)
    assert done.outcome == Outcome.REACHED
    assert done.certified
    over = np.abs(done.q[:, 0]) < 0.05
    assert (done.q[over, 2] < 0.2).all()
    through = np.stack([over_it.start, over_it.goal])
    result = swept_result(over_it.world, through, np.zeros_like(through), 1.0)
    assert result.verdict == SweptVerdict.CONTACT


def test_a_single_slide_moves_up_to_a_block(tmp_path: Path) -> None:
    path = tmp_path / "slider.urdf"
    path.write_text(SLIDER, encoding="utf-8")
    arm = load_arm(path)
    block = Sphere(name="block", radius=0.1, position=(0.9, 0.0, 0.0))
    assert run(scenario(arm, block, [-0.8], [0.65])).certified
    beyond = run(scenario(arm, block, [-0.8], [0.75]))
    assert beyond.outcome == Outcome.INFEASIBLE
    assert "car_0 and block" in beyond.detail
