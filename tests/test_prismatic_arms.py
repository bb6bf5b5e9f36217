"""Arms of slides alone, from the URDF to the certificate."""

from pathlib import Path

import numpy as np

import densarm
from densarm.certificates import swept_result
from densarm.clearance import Clearance
from densarm.proof.swept_bound import SweptBound
from densarm.proof.swept_check import SweptVerdict

GANTRY = Path(__file__).parent / "data" / "gantry.urdf"
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


def scenario(arm, obstacles, start, goal):
    return densarm.Scenario(
        name="slides",
        title="Slides",
        arm=arm,
        scene=densarm.Scene(obstacles),
        start=np.array(start),
        goal=np.array(goal),
    )


def test_gantry_lifts_its_tool_over_a_wall():
    arm = densarm.load_arm(GANTRY)
    wall = densarm.Box(name="wall", size=(0.1, 1.2, 0.3), position=(0.0, 0.0, 0.15))
    run = densarm.simulate(scenario(arm, [wall], [-0.7, 0.0, 0.45], [0.7, 0.2, 0.45]))
    assert run.outcome == densarm.Outcome.REACHED
    assert run.certified
    over = np.abs(run.q[:, 0]) < 0.05
    assert (run.q[over, 2] < 0.2).all()
    through = np.linspace(run.scenario.start, run.scenario.goal, 2)
    bound = SweptBound(Clearance(arm, run.scenario.scene))
    result = swept_result(bound, through, np.zeros_like(through), 1.0)
    assert result.verdict == SweptVerdict.CONTACT


def test_a_single_slide_moves_up_to_a_block(tmp_path):
    path = tmp_path / "slider.urdf"
    path.write_text(SLIDER, encoding="utf-8")
    arm = densarm.load_arm(path)
    block = densarm.Sphere(name="block", radius=0.1, position=(0.9, 0.0, 0.0))
    assert densarm.simulate(scenario(arm, [block], [-0.8], [0.65])).certified
    beyond = densarm.simulate(scenario(arm, [block], [-0.8], [0.75]))
    assert beyond.outcome == densarm.Outcome.INFEASIBLE
    assert "car_0 and block" in beyond.detail
