"""Scenarios: from TOML, to a task and back, and every bad input answered in one line."""

import json
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.arms.catalogue import robots_folder
from densarm.certificates.task import FORMAT, Task
from densarm.control.controller import Gains
from densarm.control.disturbance_observer import ActuationParameters
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.errors import DensarmError, FileContentError, InvalidValueError, UnknownNameError
from densarm.scenarios.control import ControlForm, ControlParameters
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene

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


def loaded(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "task.toml"
    path.write_text(text)
    return load_scenario(path)


def error_of(tmp_path: Path, text: str) -> str:
    with pytest.raises(FileContentError) as caught:
        loaded(tmp_path, text)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'task.toml'}: ")
    assert "\n" not in message
    return message.removeprefix(f"{tmp_path / 'task.toml'}: ")


def rebuilt(scenario: Scenario) -> Scenario:
    """Return a scenario from the JSON of its task."""
    return Scenario.of_task(Task.from_json(json.loads(json.dumps(scenario.task.to_json()))))


def test_swing_up_is_figure_8() -> None:
    scenario = load_scenario("swing_up")
    assert scenario.arm.angles(scenario.start) == pytest.approx((0.0, 0.0))
    assert scenario.arm.angles(scenario.goal) == pytest.approx((np.pi, 0.0))
    balls = [item for item in scenario.scene if isinstance(item, Sphere)]
    places = {(ball.position[0], ball.position[2], ball.radius) for ball in balls}
    assert places == {(-1.5, -0.5, 0.2), (1.5, -0.5, 0.2)}
    assert scenario.arm.limits.effort.tolist() == [60.0, 30.0]


def test_the_arm_and_the_world_are_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    built, init = list[int](), Arm.__init__

    def counted(*arguments: Any) -> None:
        built.append(1)
        init(*arguments)

    monkeypatch.setattr(Arm, "__init__", counted)
    scenario = load_scenario("swing_up")
    assert replace(scenario, seed=1).arm is scenario.arm
    assert scenario.world is scenario.world
    assert scenario.world.arm is scenario.arm
    assert Scenario.of_task(scenario.task).arm is scenario.arm
    Task.from_json(scenario.task.to_json())
    assert len(built) == 2


@pytest.mark.parametrize("name", ["swing_up", "panda_shelf"])
def test_round_trip_by_a_task_and_its_json(name: str) -> None:
    scenario = load_scenario(name)
    for again in (Scenario.of_task(scenario.task), rebuilt(scenario)):
        assert again.task.to_json() == scenario.task.to_json()
        # A record keeps the gains that the form of control has by default.
        assert settings_of(again) == {**settings_of(scenario), "gains": scenario.law_gains}
        np.testing.assert_array_equal([again.start, again.goal], [scenario.start, scenario.goal])


def settings_of(scenario: Scenario) -> dict[str, Any]:
    """Return all but the arm and the ends."""
    keys = set(Scenario.__dataclass_fields__) - {"arm", "start", "goal"}
    return {key: getattr(scenario, key) for key in keys}


def test_every_setting_survives_the_round_trip(swing_up: Scenario) -> None:
    """Each number, word and flag is changed, so that none can come back as its default."""
    changed = replace(
        swing_up,
        name="other",
        title="Another",
        seed=7,
        control=ControlParameters(
            form=ControlForm.REGULATION,
            guide="direct",
            margin=0.01,
            path_margin=0.03,
            kappa=np.inf,
            planning_alpha=5.0,
        ),
        density=DensityParameters(
            theta=0.01, blend_radius=0.02, gauge=Gauge.LOG, weights=(8.0, 1.0)
        ),
        gains=Gains(position=25.0, velocity=10.0),
        **{
            key: halved(getattr(swing_up, key))
            for key in ("sensing", "planning", "timing", "speed", "actuation", "simulation")
        },
    )
    again = rebuilt(changed)
    assert settings_of(again) == settings_of(changed)
    keys = ("control", "density", "sensing", "planning", "timing", "speed", "gains", "actuation")
    for key in keys:
        assert getattr(again, key) != getattr(swing_up, key)


def halved(parameters: Any) -> Any:
    """Return parameters with every number halved, but those that must be whole kept above 0.

    What is zero or not given becomes 0.01, or 2 where it must be whole.
    """
    changes = {
        key: max(1, value // 2) if isinstance(value, int) else 0.5 * value or 0.01
        for key, value in asdict(parameters).items()
        if not isinstance(value, str | None)
    }
    types = {field.name: str(field.type) for field in fields(parameters)}
    changes |= {
        key: 2 if "int" in types[key] else 0.01
        for key, value in asdict(parameters).items()
        if value is None
    }
    return replace(parameters, **changes)


def test_a_task_that_no_scenario_wrote_is_one_by_default(swing_up: Scenario) -> None:
    task = Task(swing_up.arm, swing_up.scene, swing_up.start, swing_up.goal, margin=0.01)
    scenario = Scenario.of_task(task)
    assert scenario.control == ControlParameters(margin=0.01)
    assert (scenario.actuation, scenario.seed, scenario.name) == (ActuationParameters(), 0, "run")


def test_a_task_without_a_goal_is_no_scenario(swing_up: Scenario) -> None:
    with pytest.raises(InvalidValueError, match=r"^goal = None: must be given in a scenario"):
        Scenario.of_task(replace(swing_up.task, goal=None))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"gains": {"position": -1.0}}, r"^gains.position = -1.0: must be"),
        ({"gains": {"positon": 1.0}}, r"^unknown key of \[gains\] 'positon'"),
        ({"speed": [1]}, r"^speed = \[1\]: must be a table"),
        ({"seed": -1}, r"^seed = -1: must be an integer >= 0"),
        ({"control": {"form": "track"}}, r"^control.form = 'track'"),
    ],
)
def test_settings_of_a_task_are_checked(
    swing_up: Scenario, settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(DensarmError, match=message):
        Scenario.of_task(replace(swing_up.task, settings=settings))


def test_json_keeps_what_the_file_set(tmp_path: Path) -> None:
    scenario = loaded(
        tmp_path,
        'seed = 3\ntitle = "T"\n' + BASE + BALL + "[control]\nform = 'plain'\nkappa = inf\n"
        "[simulation]\nintegrator = 'rk4'\ndt = 0.002\n[density]\ntheta = 0.01\n",
    )
    again = rebuilt(scenario)
    for key in ("name", "title", "seed", "scene", "control", "simulation"):
        assert getattr(again, key) == getattr(scenario, key)
    np.testing.assert_array_equal([again.start, again.goal], [scenario.start, scenario.goal])
    assert again.density.theta == 0.01
    assert again.simulation.integrator == "rk4"


@pytest.mark.slow
def test_a_part_of_a_robot_in_capsules(tmp_path: Path) -> None:
    robot = 'name = "panda"\njoints = ["panda_joint4", "panda_joint2"]\nshapes = "capsule"'
    scenario = loaded(
        tmp_path, BASE.replace('name = "two_link"', robot).replace("hanging", "ready")
    )
    for arm in (scenario.arm, rebuilt(scenario).arm):
        assert arm.joint_names == ("panda_joint2", "panda_joint4")
        shapes = arm.collision_model.geometryObjects
        assert {type(item.geometry).__name__ for item in shapes} == {"Capsule"}


def test_postures_by_name(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, BASE.replace("[1.0, 0.5]", '"upright"'))
    assert scenario.arm.angles(scenario.goal) == pytest.approx((np.pi, 0.0))


def test_urdf_and_srdf_are_relative_to_the_file(tmp_path: Path) -> None:
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


def test_locked_joints(tmp_path: Path) -> None:
    text = BASE.replace("[task]", "[robot.locked_joints]\nelbow = 0.3\n[task]")
    text = text.replace('"hanging"', "[0.0]").replace("[1.0, 0.5]", "[1.0]")
    assert loaded(tmp_path, text).arm.nv == 1


def test_cut_joints(tmp_path: Path) -> None:
    text = BASE.replace("[task]", 'cut_joints = ["elbow"]\n[task]')
    text = text.replace('"hanging"', "[0.0]").replace("[1.0, 0.5]", "[1.0]")
    scenario = loaded(tmp_path, text)
    assert scenario.arm.joint_names == ("shoulder",)
    again = rebuilt(scenario)
    assert again.arm.joint_names == ("shoulder",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = ", "not TOML"),
        ("x = 2023-13-45", "not TOML"),
        (
            "gaols = 1\n" + BASE,
            "unknown key 'gaols'; did you mean 'gains'? (known: actuation, control",
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
        (BASE + "[density]\nweights = [1, 0]\n", "density.weights = 0.0: must be a finite"),
        (BASE + "[density]\nweights = [1, -2]\n", "density.weights = -2.0"),
        (BASE + "[density]\nweights = [1, nan]\n", "density.weights = (1.0, nan)"),
        (BASE + "[density]\nweights = [1, 2, 3]\n", "of shape (2,), got (3,): one per joint"),
        (BASE + "[density]\nweights = []\n", "of shape (2,), got (0,)"),
        (BASE + "[density]\nweights = 'mass'\n", "one number > 0 per joint, or 'inertia'"),
        (BASE + "[density]\nweights = 2\n", "density.weights = 2"),
        (BASE + "[density]\ngauge = 'logarithm'\n", "density.gauge = 'logarithm'"),
        (BASE + "[density]\nblend_radius = 0.05\n", "density.blend_radius = 0.05: must be 0 in"),
        (
            BASE + PLAIN + "[density]\ngauge = 'log'\n",
            "density.blend_radius = 0.0: must be above 0",
        ),
        (BASE + PLAIN + "[density]\nalpha = 2.0\n", "density.blend_radius = 0.0: must be above 0"),
        (BASE + "[density]\ngauge = 'log'\n", "control.form = 'tracking': must be 'regulation'"),
        (BASE + "[density]\nalpha = 2.0\n", "with alpha = 2, whose gradient"),
    ],
)
def test_bad_input_is_one_line_with_key_value_and_what_is_allowed(
    tmp_path: Path, text: str, message: str
) -> None:
    assert message in error_of(tmp_path, text)


def test_a_missing_urdf_is_named_itself(tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match=r"no\.urdf: No such file"):
        loaded(tmp_path, BASE.replace('name = "two_link"', 'urdf = "no.urdf"'))


def test_a_gauge_that_is_blended_is_accepted(tmp_path: Path) -> None:
    text = BASE + PLAIN + "[density]\ngauge = 'density'\nblend_radius = 0.05\n"
    scenario = loaded(tmp_path, text)
    assert scenario.density.blend_radius == 0.05


def test_unknown_scenario_lists_the_known() -> None:
    with pytest.raises(UnknownNameError, match=r"did you mean 'swing_up'.*panda_shelf"):
        load_scenario("swingup")


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match="No such file"):
        load_scenario(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileContentError, match="text file"):
        load_scenario(tmp_path / "bytes.toml")
    with pytest.raises(DensarmError):
        load_scenario(tmp_path)


def test_wrong_length_in_python() -> None:
    scenario = load_scenario("swing_up")
    with pytest.raises(
        InvalidValueError, match=r"^goal configuration = .*shape \(4,\), got \(3,\)"
    ):
        replace(scenario, goal=np.array([1.0, 2.0, 3.0]))


def test_json_that_is_not_a_task() -> None:
    whole = load_scenario("swing_up").task.to_json()
    assert whole["format"] == FORMAT
    broken: list[Any] = [None, [], {}, {"format": 0}, {**whole, "format": FORMAT + 1}]
    for data in broken:
        with pytest.raises(DensarmError, match="not of format"):
            Task.from_json(data)
    settings = {"seed", "planning", "timing", "speed", "gains", "actuation"}
    for key in set(whole) - {"format", "input", "plant", "disturbances", *settings}:
        with pytest.raises(DensarmError, match=key):
            Task.from_json({k: v for k, v in whole.items() if k != key})


def test_scene_of_a_scenario_may_be_replaced() -> None:
    scenario = load_scenario("swing_up")
    assert scenario.world.n_pairs > 0
    assert replace(scenario, scene=Scene()).world.n_pairs == 0


def test_degrees_are_asked_about(tmp_path: Path) -> None:
    degrees, ready = "[-68.7, -45, 0, -135, 0, 90, 45]", '"ready"'
    robot = '[robot]\nname = "panda"\n[task]\n'
    message = r"task.start = .*: must be in radians, -2.897 to 2.897 for 'panda_joint1', not -68.7"
    with pytest.raises(FileContentError, match=rf"{message}: are these degrees\?"):
        loaded(tmp_path, f"{robot}start = {degrees}\ngoal = {ready}\n")
    with pytest.raises(FileContentError, match=r"task.goal = .* are these degrees"):
        loaded(tmp_path, f"{robot}start = {ready}\ngoal = {degrees}\n")


def test_many_turns_of_a_continuous_joint_are_no_degrees(tmp_path: Path) -> None:
    assert loaded(tmp_path, BASE.replace("[1.0, 0.5]", "[90.0, 0.5]")).arm.continuous[0]


def test_positions_just_outside_the_limits_are_left_to_the_planner(tmp_path: Path) -> None:
    robot = '[robot]\nname = "panda"\n[task]\nstart = "ready"\n'
    loaded(tmp_path, f"{robot}goal = [0, 0, 0, 6.0, 0, 1, 0]\n")
