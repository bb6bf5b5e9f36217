"""Steps: from TOML, and every one that cannot be is refused in one line."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import densarm
from densarm.arms.catalogue import scenario_paths
from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.scenarios.run import plan
from densarm.scenarios.scenario import load_scenario
from densarm.scenarios.steps import Step, gripper_positions, touching
from densarm.world.world import World

SCENE = scenario_paths()["panda_pick_place"].read_text().split("# Can 1")[0]
WAIT, TAKE = "wait = 1", 'attach = { body = "can_1", link = "panda_hand" }'
TCP = "panda_hand_tcp"


def load(tmp_path: Path, *steps: str, scene: str = SCENE) -> densarm.Scenario:
    path = tmp_path / "task.toml"
    path.write_text("\n".join([scene, *(f"[[steps]]\n{step}" for step in steps)]))
    return load_scenario(path)


def test_every_kind_of_step(tmp_path: Path) -> None:
    scenario = load(
        tmp_path,
        'move_to = [{ frame = "panda_hand_tcp", position = [0.5, 0, 0.4] }, "ready"]',
        'line = { frame = "panda_hand_tcp", to = { position = [0.5, 0, 0.3] } }',
        "grip = { panda_finger_joint1 = 0.03 }",
        'attach = { body = "can_1", link = "panda_hand", mass = 0.5, support = "table" }',
        'line = { frame = "panda_hand_tcp", by = [0, 0, 0.1] }',
        'detach = "can_1"',
        "wait = 0.5",
    )
    move, line, grip, attach, lift, detach, wait = scenario.steps
    assert isinstance(move, densarm.MoveTo)
    assert line == densarm.Line(TCP, densarm.Pose(TCP, [0.5, 0.0, 0.3]))
    assert grip == densarm.Grip({"panda_finger_joint1": 0.03})
    assert attach == densarm.Attach("can_1", "panda_hand", 0.5, "table")
    assert lift == densarm.Line(TCP, by=[0.0, 0.0, 0.1])
    assert (detach, wait) == (densarm.Detach("can_1"), densarm.Wait(0.5))
    assert (scenario.goal == scenario.start).all()
    assert [str(step) for step in (lift, attach, grip, wait)] == [
        "line of 'panda_hand_tcp' by (0, 0, 0.1) m",
        "attach 'can_1' to 'panda_hand'",
        "grip: panda_finger_joint1 0.03",
        "wait 0.5 s",
    ]


def test_way_points_are_told_beside_a_move(tmp_path: Path) -> None:
    beside = '\nthrough = ["ready", { frame = "panda_hand_tcp", position = [0.5, 0, 0.4] }]'
    plain, wide = load(
        tmp_path, 'move_to = "ready"' + beside, f'blend = 0.1{beside}\nmove_to = "ready"'
    ).steps
    assert isinstance(plain, densarm.MoveTo)
    assert isinstance(wide, densarm.MoveTo)
    through: Any = plain.through
    posture, pose = through
    assert posture == pytest.approx(densarm.load_arm("panda").postures["ready"])
    assert pose == densarm.Pose(TCP, [0.5, 0.0, 0.4])
    assert (plain.blend, wide.blend) == (0.05, 0.1)
    assert plain.upright is None
    (level,) = load(tmp_path, f'move_to = "ready"\nupright = "{TCP}"\ntilt = 0.2').steps
    assert isinstance(level, densarm.MoveTo)
    assert (level.upright, level.tilt) == (TCP, 0.2)
    assert str(plain) == "move to a goal, through way points"


def test_a_body_may_touch_its_support_in_the_line_beside_alone() -> None:
    up, rest = densarm.Line(TCP, by=[0.0, 0.0, 0.1]), densarm.Wait(1.0)
    take, put = densarm.Attach("a", "hand", 1.0, "table"), densarm.Detach("a", "box")
    steps: list[Step] = [up, take, up, rest, up, put, up]
    found = [touching(steps, k) for k in range(len(steps))]
    assert found == [{}, {}, {"a": "table"}, {}, {"a": "box"}, {}, {}]


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        (['move = "ready"'], "unknown key of steps[0] 'move'; did you mean 'move_to'?"),
        (['move_to = "redy"'], "unknown posture for steps[0].move_to 'redy'"),
        (['move_to = { frame = "tcp", position = [0, 0, 1] }'], "unknown frame of steps[0] 'tcp'"),
        (['line = { frame = "panda_hand_tcp" }'], "steps[0].line = []: must be told by one of to"),
        (['line = { frame = "panda_hand_tcp", by = [0, 1] }'], "steps[0].by = (0.0, 1.0): must be"),
        (['line = { frame = "tcp", by = [0, 0, 1] }'], "unknown frame of steps[0] 'tcp'"),
        (['move_to = "ready"\nthrough = "redy"'], "unknown posture for steps[0].through 'redy'"),
        (['move_to = "ready"\nblend = 0'], "steps[0].blend = 0.0: must be at least 0.01 rad or m"),
        (['move_to = "ready"\nupright = "tcp"'], "unknown frame of steps[0] 'tcp'"),
        (['move_to = "ready"\ntilt = 5'], "steps[0].tilt = 5.0: must be from 0.01 to π/2 rad"),
        (['move_to = "ready"\nwait = 1'], "unknown key of [steps[0]] 'wait'"),
        (
            ['move_to = "ready"\nthrough = { frame = "tcp", position = [0, 0, 1] }'],
            "unknown frame of steps[0] 'tcp'",
        ),
        (["grip = { panda_joint1 = 0.1 }"], "unknown joint of a gripper 'panda_joint1'"),
        (["wait = -1"], "steps[0].wait = -1.0: must be a finite number > 0"),
        ([WAIT, 'detach = "can_1"'], "steps[1].detach = 'can_1': must be one of the held: none"),
        ([WAIT, 'detach = "can_9"'], "unknown body of steps[1].detach 'can_9'"),
        ([WAIT, TAKE, TAKE], "steps[2].attach = 'can_1': must be a body that is not held yet"),
        ([WAIT, TAKE.replace("can_1", "can_9")], "(known: bottom, can_1, can_2, can_3, far_side"),
        ([WAIT, TAKE.replace("panda_hand", "hand")], "unknown frame of steps[1] 'hand'"),
        ([WAIT, TAKE.replace(" }", ', support = "shelf" }')], "unknown support of steps[1].attach"),
        ([WAIT, TAKE.replace(" }", ", mass = -1 }")], "steps[1].attach.mass = -1.0: must be a fin"),
        ([WAIT, 'attach = { body = "can_1" }'], "steps[1].attach.link = None: must be given"),
        (
            [WAIT, TAKE],
            "last of steps = \"attach 'can_1' to 'panda_hand'\": must be one that takes",
        ),
    ],
)
def test_what_is_no_step(tmp_path: Path, steps: list[str], told: str) -> None:
    with pytest.raises(FileContentError) as caught:
        load(tmp_path, *steps)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_steps_are_in_place_of_a_goal_among_what_stands(tmp_path: Path) -> None:
    with pytest.raises(DensarmError, match=r"task.goal = .*: must be left out where there are"):
        load(tmp_path, WAIT, scene=SCENE.replace("[task]", '[task]\ngoal = "ready"'))
    moving = SCENE + '[obstacles.motion]\ntype = "constant_velocity"\nlinear = [0.1, 0, 0]\n'
    with pytest.raises(DensarmError, match=r"steps = \['can_3'\]: must be without obstacles that"):
        load(tmp_path, WAIT, scene=moving)
    with pytest.raises(DensarmError, match=r"control.form = 'regulation': must be 'tracking'"):
        load(tmp_path, WAIT, scene=SCENE + "[control]\nform = 'regulation'\n")
    with pytest.raises(DensarmError, match="left out, where one motion to a goal is meant"):
        plan(load(tmp_path, WAIT))


def test_joints_of_a_gripper_that_mimic_others_go_with_them(can_on_a_table: World) -> None:
    fingers = ["panda_finger_joint1", "panda_finger_joint2"]
    description = can_on_a_table.arm.description
    for locked in ({fingers[0]: 0.04}, dict.fromkeys(fingers, 0.04)):
        arm = replace(description, locked_joints=locked)
        found = gripper_positions(arm, densarm.Grip({fingers[0]: 0.02}))
        assert found == dict.fromkeys(fingers, 0.02)


def test_a_floor_is_not_taken(can_on_a_table: World) -> None:
    arm, floor = can_on_a_table.arm, densarm.HalfSpace(name="floor", position=[0.0, 0.0, -1.0])
    steps = [densarm.Attach("floor", "panda_hand"), densarm.Wait(0.1)]
    with pytest.raises(InvalidValueError, match="must be a body that has an end"):
        densarm.run_steps(World(arm, densarm.Scene([floor])), arm.postures["ready"], steps)


def test_what_is_no_step_in_python(can_on_a_table: World) -> None:
    start = can_on_a_table.arm.postures["ready"]
    with pytest.raises(InvalidValueError, match=r"steps\[0\] = 'wait': must be a MoveTo, Line,"):
        densarm.run_steps(can_on_a_table, start, ["wait"])
    with pytest.raises(InvalidValueError, match=r"steps = \[\]: must be at least one"):
        densarm.run_steps(can_on_a_table, start, [])
