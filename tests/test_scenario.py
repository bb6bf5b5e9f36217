"""Scenarios: from TOML and JSON and back, and every bad input answered in one line."""

import json
from dataclasses import replace

import numpy as np
import pytest

import densarm.scenario
from densarm.arm import Arm
from densarm.catalogue import robots_folder
from densarm.errors import DensarmError, FileContentError, InvalidValueError, UnknownNameError
from densarm.scenario import Scenario, load_scenario
from densarm.scene import Scene

BASE = """
[robot]
name = "two_link"
[task]
start = "hanging"
goal = [1.0, 0.5]
"""
PLAIN = "[control]\nform = 'plain'\n"
BALL = """
[[obstacles]]
type = "sphere"
name = "ball"
radius = 0.1
"""


def loaded(tmp_path, text):
    path = tmp_path / "task.toml"
    path.write_text(text)
    return load_scenario(path)


def error_of(tmp_path, text):
    with pytest.raises(FileContentError) as caught:
        loaded(tmp_path, text)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'task.toml'}: ")
    assert "\n" not in message
    return message.removeprefix(f"{tmp_path / 'task.toml'}: ")


def test_swing_up_is_figure_8():
    scenario = load_scenario("swing_up")
    assert scenario.arm.angles(scenario.start) == pytest.approx((0.0, 0.0))
    assert scenario.arm.angles(scenario.goal) == pytest.approx((np.pi, 0.0))
    places = {(o.position[0], o.position[2], o.radius) for o in scenario.scene}
    assert places == {(-1.5, -0.5, 0.2), (1.5, -0.5, 0.2)}
    assert scenario.arm.limits.effort.tolist() == [60.0, 30.0]


def test_the_arm_is_built_once(monkeypatch):
    built = []
    init = Arm.__init__
    monkeypatch.setattr(Arm, "__init__", lambda *args: built.append(1) or init(*args))
    scenario = load_scenario("swing_up")
    assert replace(scenario, seed=1).arm is scenario.arm
    Scenario.from_json(scenario.to_json())
    assert len(built) == 2


@pytest.mark.parametrize("name", ["swing_up", "panda_shelf"])
def test_json_round_trip(name):
    scenario = load_scenario(name)
    data = json.loads(json.dumps(scenario.to_json()))
    assert Scenario.from_json(data).to_json() == scenario.to_json()


def test_json_keeps_what_the_file_set(tmp_path):
    scenario = loaded(
        tmp_path,
        'seed = 3\ntitle = "T"\n' + BASE + BALL + "[control]\nform = 'plain'\nkappa = inf\n"
        "[simulation]\nintegrator = 'rk4'\ndt = 0.002\n[density]\ntheta = 0.01\n",
    )
    again = Scenario.from_json(json.loads(json.dumps(scenario.to_json())))
    for key in ("name", "title", "seed", "scene", "control", "simulation"):
        assert getattr(again, key) == getattr(scenario, key)
    np.testing.assert_array_equal([again.start, again.goal], [scenario.start, scenario.goal])
    assert again.density.theta == 0.01
    assert again.simulation.integrator == "rk4"


def test_a_part_of_a_robot_in_capsules(tmp_path):
    robot = 'name = "panda"\njoints = ["panda_joint4", "panda_joint2"]\nshapes = "capsule"'
    scenario = loaded(
        tmp_path, BASE.replace('name = "two_link"', robot).replace("hanging", "ready")
    )
    for arm in (scenario.arm, Scenario.from_json(scenario.to_json()).arm):
        assert arm.joint_names == ("panda_joint2", "panda_joint4")
        shapes = arm.collision_model.geometryObjects
        assert {type(item.geometry).__name__ for item in shapes} == {"Capsule"}


def test_postures_by_name(tmp_path):
    scenario = loaded(tmp_path, BASE.replace("[1.0, 0.5]", '"upright"'))
    assert scenario.arm.angles(scenario.goal) == pytest.approx((np.pi, 0.0))


def test_urdf_and_srdf_are_relative_to_the_file(tmp_path):
    urdf = (robots_folder() / "two_link" / "robot.urdf").read_text()
    folder = tmp_path / "arms" / "mine"
    folder.mkdir(parents=True)
    (folder / "arm.urdf").write_text(urdf)
    (folder / "arm.srdf").write_text(
        '<robot name="two_link"><group_state name="bent" group="arm">'
        '<joint name="shoulder" value="0.5"/><joint name="elbow" value="1"/></group_state></robot>'
    )
    text = '[robot]\nurdf = "arms/mine/arm.urdf"\nsrdf = "arms/mine/arm.srdf"\n'
    text += "acceleration = [5.0, 6.0]\nbase_placement = [0, 0, 1, 0, 0, 0, 1]\n"
    scenario = loaded(tmp_path, text + '[task]\nstart = "bent"\ngoal = [0, 0]\n')
    assert scenario.arm.angles(scenario.start) == pytest.approx((0.5, 1.0))
    assert scenario.arm.limits.acceleration.tolist() == [5.0, 6.0]
    assert scenario.arm.description.base_placement[2] == 1.0


def test_locked_joints(tmp_path):
    text = BASE.replace("[task]", "[robot.locked_joints]\nelbow = 0.3\n[task]")
    text = text.replace('"hanging"', "[0.0]").replace("[1.0, 0.5]", "[1.0]")
    assert loaded(tmp_path, text).arm.nv == 1


def test_cut_joints(tmp_path):
    text = BASE.replace("[task]", 'cut_joints = ["elbow"]\n[task]')
    text = text.replace('"hanging"', "[0.0]").replace("[1.0, 0.5]", "[1.0]")
    scenario = loaded(tmp_path, text)
    assert scenario.arm.joint_names == ("shoulder",)
    again = Scenario.from_json(scenario.to_json())
    assert again.arm.joint_names == ("shoulder",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = ", "not TOML"),
        ("x = 2023-13-45", "not TOML"),
        (
            "gaols = 1\n" + BASE,
            "unknown key 'gaols'; did you mean 'gains'? (known: control, density",
        ),
        (BASE + "[contrl]\n", "unknown key 'contrl'; did you mean 'control'?"),
        (BASE + "[control]\nfrom = 1\n", "unknown key of [control] 'from'; did you mean 'form'?"),
        (
            BASE.replace('"two_link"', '"two_lnk"'),
            "unknown robot 'two_lnk'; did you mean 'two_link'",
        ),
        (BASE.replace('name = "two_link"', ""), "a table with either name or urdf"),
        (BASE.replace("[robot]", '[robot]\nurdf = "x.urdf"'), "a table with either name or urdf"),
        (BASE.replace('name = "two_link"', "name = 3"), "robot.name = 3: must be"),
        (BASE.replace('"hanging"', '"hangin"'), "'hangin'; did you mean 'hanging'?"),
        (BASE.replace("[1.0, 0.5]", "[1.0]"), "of shape (2,), got (1,)"),
        (BASE.replace("[1.0, 0.5]", "[1.0, nan]"), "task.goal"),
        (BASE.replace("[1.0, 0.5]", "[1.0, inf]"), "must be finite numbers"),
        (BASE.replace("[1.0, 0.5]", "7"), "task.goal = 7"),
        (BASE.replace("goal = [1.0, 0.5]", ""), "task.goal"),
        ("seed = -1\n" + BASE, "seed = -1: must be an integer >= 0"),
        ("seed = 1.5\n" + BASE, "seed = 1.5: must be an integer >= 0"),
        ("seed = true\n" + BASE, "seed = True: must be an integer >= 0"),
        ("obstacles = 3\n" + BASE, "obstacles = 3: must be a list"),
        ("robot = 3\n", "robot = 3: must be a table"),
        ("control = [1]\n" + BASE, "control = [1]: must be a table"),
        (BASE + BALL.replace("0.1", "0.0"), "ball.radius = 0.0: must be a finite number > 0"),
        (BASE + BALL.replace("0.1", "-1"), "ball.radius = -1"),
        (BASE + BALL.replace("0.1", "nan"), "ball.radius = nan"),
        (BASE + BALL.replace('"sphere"', '"ball"'), "unknown type of obstacle ball 'ball'"),
        (BASE + BALL.replace("radius", "radis"), "'radis'; did you mean 'radius'?"),
        (BASE + BALL + "position = [0, 0]\n", "of shape (3,), got (2,)"),
        (BASE + BALL + BALL, "used only once"),
        (BASE + "[control]\nform = 'track'\n", "control.form = 'track'"),
        (BASE + "[control]\nmargin = -0.1\n", "control.margin = -0.1"),
        (BASE + "[control]\nmargin = '5 mm'\n", "control.margin = '5 mm'"),
        (BASE + "[control]\nkappa = 0\n", "control.kappa = 0"),
        (BASE + "[control]\nplanning_alpha = 0\n", "control.planning_alpha = 0"),
        (BASE + "[control]\nkappa = nan\n", "control.kappa = nan"),
        (BASE + "[control]\nguide = 'astar'\n", "control.guide = 'astar'"),
        (BASE + "[simulation]\ndt = 0\n", "simulation.dt = 0"),
        (BASE + "[simulation]\ndt = nan\n", "simulation.dt = nan"),
        (BASE + "[simulation]\nintegrator = 'euler'\n", "'semi_implicit_euler' or 'rk4'"),
        (BASE + "[simulation]\ncontrol_divisor = 1.5\n", "simulation.control_divisor = 1.5"),
        (BASE + "[gains]\nposition = -1\n", "gains.position = -1"),
        (BASE + "[sensing]\npath_share = 2\n", "sensing.path_share = 2"),
        (BASE + "[speed]\nbraking_share = 0\n", "speed.braking_share = 0"),
        (BASE + "[timing]\ntorque_share = 1.5\n", "timing.torque_share = 1.5"),
        (BASE + "[planning]\niterations = 0\n", "planning.iterations = 0"),
        (BASE + "[density]\nalpha = -1\n", "density.alpha = -1"),
        (BASE + "[density]\ngauge = 'logarithm'\n", "density.gauge = 'logarithm'"),
        (
            BASE + PLAIN + "[density]\ngauge = 'log'\n",
            "density.blend_radius = 0.0: must be above 0",
        ),
        (BASE + PLAIN + "[density]\nalpha = 2.0\n", "density.blend_radius = 0.0: must be above 0"),
        (BASE + "[density]\ngauge = 'log'\n", "control.form = 'tracking': must be 'regulation'"),
        (BASE + "[density]\nalpha = 2.0\nblend_radius = 0.1\n", "with alpha = 2, whose gradient"),
    ],
)
def test_bad_input_is_one_line_with_key_value_and_what_is_allowed(tmp_path, text, message):
    assert message in error_of(tmp_path, text)


def test_a_missing_urdf_is_named_itself(tmp_path):
    with pytest.raises(FileContentError, match=r"no\.urdf: No such file"):
        loaded(tmp_path, BASE.replace('name = "two_link"', 'urdf = "no.urdf"'))


def test_a_gauge_that_is_blended_is_accepted(tmp_path):
    text = BASE + PLAIN + "[density]\ngauge = 'density'\nblend_radius = 0.05\n"
    scenario = loaded(tmp_path, text)
    assert scenario.density.blend_radius == 0.05


def test_unknown_scenario_lists_the_known():
    with pytest.raises(UnknownNameError, match=r"did you mean 'swing_up'.*panda_shelf"):
        load_scenario("swingup")


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(FileContentError, match="No such file"):
        load_scenario(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileContentError, match="text file"):
        load_scenario(tmp_path / "bytes.toml")
    with pytest.raises(DensarmError):
        load_scenario(tmp_path)


def test_wrong_length_in_python():
    scenario = load_scenario("swing_up")
    with pytest.raises(
        InvalidValueError, match=r"^goal configuration = .*shape \(4,\), got \(3,\)"
    ):
        replace(scenario, goal=(1.0, 2.0, 3.0))


def test_json_that_is_not_a_scenario():
    whole = load_scenario("swing_up").to_json()
    for data in (None, [], {}, {"format": 0}, {**whole, "format": 2}):
        with pytest.raises(DensarmError, match="not of format"):
            Scenario.from_json(data)
    for key in set(whole) - {"format"}:
        with pytest.raises(DensarmError, match=key):
            Scenario.from_json({k: v for k, v in whole.items() if k != key})


def test_scene_of_a_scenario_may_be_replaced():
    scenario = load_scenario("swing_up")
    assert len(replace(scenario, scene=Scene()).scene) == 0
    assert scenario.to_json()["format"] == densarm.scenario.FORMAT
