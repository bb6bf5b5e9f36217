"""The plant in MuJoCo: the same dynamics, the same contacts, its own words."""

import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.task import SimulationParameters
from densarm.errors import DensarmError, InvalidValueError
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.disturbances import Disturbances
from densarm.simulation.mujoco_plant import MujocoPlant
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World

AGREE = 1e-9  # [kg·m², N·m]
SHALLOW = 2e-5  # [m], within which engines need not agree on a contact
ARMS = ("two_link", "panda", "ur5", "kinova")  # kinova has continuous joints
SCENE = Scene(
    [
        Box(
            name="box",
            size=[0.3, 0.4, 0.5],
            position=[0.5, 0.2, 0.3],
            orientation_xyzw=[0.1, 0.2, 0, 0.97],
        ),
        Sphere(name="ball", radius=0.15, position=[-0.4, 0.3, 0.5]),
        Capsule(name="rod", radius=0.05, length=0.6, position=[0.3, -0.5, 0.4]),
        Cylinder(name="can", radius=0.1, length=0.3, position=[-0.3, -0.4, 0.6]),
        HalfSpace(name="wall", normal=[-1.0, 0.2, 0.1], offset=-0.7),
    ]
)


class Torque:
    """One torque at all times."""

    def __init__(self, tau: Array) -> None:
        self.tau = tau

    def torque(self, *_: object) -> Array:
        return self.tau


def dynamics(plant: MujocoPlant, arm: Arm, angles: Array, v: Array) -> tuple[Array, Array]:
    plant.data.qpos[:], plant.data.qvel[:] = angles, v
    mujoco.mj_forward(plant.model, plant.data)
    mass = np.zeros((arm.nv, arm.nv))
    mujoco.mj_fullM(plant.model, plant.data, mass)
    return mass, plant.data.qfrc_bias.copy()


@pytest.mark.parametrize("name", ARMS)
def test_mass_matrix_and_nonlinear_effects(name: str) -> None:
    arm = load_arm(name)
    plant, random = MujocoPlant(World(arm, Scene())), np.random.default_rng(0)
    for angles, v in random.uniform(-2.0, 2.0, (20, 2, arm.nv)):
        mass, bias = dynamics(plant, arm, angles, v)
        q = arm.configuration(angles)
        np.testing.assert_allclose(arm.mass_matrix(q), mass, rtol=0, atol=AGREE)
        np.testing.assert_allclose(arm.nonlinear_effects(q, v), bias, rtol=0, atol=AGREE)


@pytest.mark.parametrize("name", ARMS)
def test_finds_the_contacts_that_coal_measures(name: str) -> None:
    arm = load_arm(name)
    world, random = World(arm, SCENE), np.random.default_rng(1)
    plant, found = MujocoPlant(world), []
    bound = np.clip(arm.limits.upper, -np.pi, np.pi), np.clip(arm.limits.lower, -np.pi, np.pi)
    for angles in random.uniform(*bound[::-1], (60, arm.nv)):
        q = arm.configuration(angles)
        smallest = float(world.distances(q).min())
        plant.step(q, np.zeros(arm.nv), np.zeros(arm.nv))
        if abs(smallest) > 1e-3:  # the step itself moves the arm
            assert bool(plant.describe_contact()) == (smallest < 0.0), (angles, smallest)
            found.append(smallest < 0.0)
    assert 0 < sum(found) < len(found)


def test_follows_obstacles_that_move_come_and_go() -> None:
    arm = load_arm("two_link")
    spare = [Sphere(name="later", radius=0.05), HalfSpace(name="floor")]
    scene = Scene([Sphere(name="ball", radius=0.1, position=[5.0, 0.0, 0.0])])
    world = World(arm, scene, spare=spare)
    plant, q, zero = MujocoPlant(world), arm.configuration([0.0, 0.0]), np.zeros(2)

    def touching() -> str:
        plant.step(q, zero, zero)
        assert bool(plant.describe_contact()) == bool((world.distances(q) < 0.0).any())
        return plant.describe_contact()

    assert not touching()
    world.move_obstacle("ball", [0.0, 0.0, -1.0])
    assert "ball" in touching()
    world.remove_obstacle("ball")
    assert not touching()
    world.add_obstacle(Sphere(name="large", radius=0.9, position=[0.0, 0.8, -1.0]))
    assert "large" in touching()


@pytest.mark.parametrize("armature", [None, 0.1])
def test_moves_as_the_model_does(armature: float | None) -> None:
    arm = load_arm("panda", armature=armature)
    world = World(arm, Scene())
    plants = MujocoPlant(world, 1e-4), PinocchioPlant(arm, 1e-4)
    q, v = arm.postures["ready"], np.zeros(arm.nv)
    tau = arm.nonlinear_effects(q, v) + 0.1
    ends = []
    for plant in plants:
        state = q, v
        for _ in range(1000):
            state = plant.step(*state, tau)
        ends.append(state)
    np.testing.assert_allclose(ends[0][0], ends[1][0], rtol=0, atol=1e-3)
    np.testing.assert_allclose(ends[0][1], ends[1][1], rtol=0, atol=2e-3)


def test_a_used_plant_begins_anew() -> None:
    arm = load_arm("two_link")
    plant = MujocoPlant(World(arm, Scene()), disturbances=Disturbances(coulomb=0.5))
    ends = []
    for _ in range(2):
        q, v = arm.configuration([0.5, 0.2]), np.zeros(2)
        for _ in range(50):
            q, v = plant.step(q, v, np.zeros(2))
        ends.append(np.concatenate([q, v]))
    np.testing.assert_array_equal(ends[0], ends[1])


def test_a_run_ends_where_mujoco_finds_a_contact() -> None:
    arm = load_arm("two_link")
    world = World(arm, Scene([Box(name="wall", size=[0.1, 1.0, 2.0], position=[0.9, 0.0, 0.0])]))
    parameters = SimulationParameters(time_limit=3.0)
    start = arm.configuration([0.0, 0.0])
    run = simulate(
        world, Torque(np.array([30.0, 0.0])), start, plant="mujoco", parameters=parameters
    )
    assert run.outcome == Outcome.COLLIDED
    assert "wall" in run.detail
    assert "by MuJoCo" in run.detail
    assert "by coal" in run.detail
    assert run.task.plant == "mujoco"
    assert abs(run.clearance[-1]) < 5e-3


def test_what_diverges_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    arm = load_arm("two_link")
    plant, state = MujocoPlant(World(arm, Scene())), (arm.configuration([0.0, 0.0]), np.zeros(2))
    for k in range(20):
        state = plant.step(*state, np.array([1e12, -1e12]) * (-1.0) ** k)
    assert not np.isfinite(state[1]).all() or np.abs(state[1]).max() > 1e6
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr().err == ""


def test_without_mujoco_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(DensarmError, match=r"pip install 'densarm\[mujoco\]'"):
        MujocoPlant(World(load_arm("two_link"), Scene()))


def test_unknown_plant_is_refused() -> None:
    world = World(load_arm("two_link"), Scene())
    with pytest.raises(
        InvalidValueError, match=r"plant = 'bullet': must be one of mujoco, pinocchio"
    ):
        simulate(world, Torque(np.zeros(2)), world.arm.postures["neutral"], plant="bullet")


MJCF = """<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 1" pos="0 0 -3"/>
  <body name="upper"><joint name="shoulder" axis="0 -1 0" range="-1 1" damping="0.3"/>
    <geom name="upper" type="capsule" fromto="0 0 0 0 0 -1" size="0.05" mass="1"/>
    <body name="lower" pos="0 0 -1"><joint name="elbow" axis="0 -1 0"/>
      <geom name="lower" type="capsule" fromto="0 0 0 0 0 -1" size="0.05" mass="1"/>
      <body name="finger" pos="0 0 -1"><joint name="grip" type="slide"/>
        <geom type="sphere" size="0.02" mass="0.1"/></body>
    </body>
  </body>
</worldbody>
<actuator><position joint="shoulder" kp="1000"/></actuator></mujoco>"""


def own(tmp_path: Path, world: World, text: str = MJCF, **options: Any) -> MujocoPlant:
    path = tmp_path / "arm.xml"
    path.write_text(text, encoding="utf-8")
    return MujocoPlant.from_mjcf(world, path, **options)


def test_a_model_of_ones_own_has_its_own_masses_and_contacts(tmp_path: Path) -> None:
    arm = load_arm("two_link")
    world = World(arm, Scene([Sphere(name="ball", radius=0.1, position=[0.5, 0.0, 0.0])]))
    plant, zero = own(tmp_path, world), np.zeros(2)
    q = arm.configuration([1.2, 0.3])
    plant.step(q, np.array([0.5, -0.2]), zero)
    assert plant.describe_contact() == ""
    plant.step(arm.configuration([np.pi / 2.0, 0.0]), zero, zero)
    assert {"upper", "ball"} < set(plant.describe_contact().replace(",", "").split())
    # The actuator wants the shoulder at zero, and its limit is at 1 rad: neither acts.
    plant.step(q, np.array([1e-9, 0.0]), zero)
    hold = plant.data.qfrc_bias[:2].copy()
    _, after = plant.step(q, np.zeros(2), hold)
    assert np.abs(after).max() < 0.01


def test_a_model_of_ones_own_may_be_disturbed_and_name_joints_otherwise(tmp_path: Path) -> None:
    world = World(load_arm("two_link"), Scene())
    plain = own(tmp_path, world)
    renamed = MJCF.replace('"shoulder"', '"j1"').replace('"elbow"', '"j2"')
    told = Disturbances(mass_scale=2.0, coulomb=0.5, armature=0.1, viscous=0.2, base_tilt_deg=90.0)
    other = own(tmp_path, world, renamed, joints=["j1", "j2"], disturbances=told)
    np.testing.assert_allclose(other.model.body_mass[1:], 2.0 * plain.model.body_mass[1:])
    np.testing.assert_allclose(other.model.dof_damping[:2], plain.model.dof_damping[:2] + 0.2)
    np.testing.assert_allclose(other.model.dof_frictionloss[:2], 0.5)
    np.testing.assert_allclose(other.model.opt.gravity, [0.0, -9.81, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '"elbow"',
            '"wrist"',
            "arm's, shoulder, elbow, are looked for, and the MJCF has shoulder, wrist, grip:",
        ),
        ('axis="0 -1 0"/>', 'axis="0 1 0"/>', r"^joint 'elbow' of the MJCF = .*turned by 3.1 rad"),
        ('pos="0 0 -1"><joint name="elbow"', 'pos="0 0 -0.9"><joint name="elbow"', "100 mm away"),
        ("<mujoco>", "<mujo>", "arm.xml: .*XML"),
    ],
)
def test_a_model_that_does_not_match(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(DensarmError, match=message) as caught:
        own(tmp_path, World(load_arm("two_link"), Scene()), MJCF.replace(old, new))
    assert "\n" not in str(caught.value)


def test_a_model_of_ones_own_takes_no_payload(tmp_path: Path) -> None:
    world = World(load_arm("two_link"), Scene())
    with pytest.raises(InvalidValueError, match=r"payload = 1.0: must be a body of one's own MJCF"):
        own(tmp_path, world, disturbances=Disturbances(payload=1.0))
    with pytest.raises(DensarmError, match="No such file"):
        MujocoPlant.from_mjcf(world, tmp_path / "none.xml")


def test_viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    import glfw
    import mujoco.viewer

    class Window:
        shown = 0

        def is_running(self) -> bool:
            return True

        def sync(self) -> None:
            self.shown += 1

    window, arm = Window(), load_arm("two_link")
    plant, q, zero = MujocoPlant(World(arm, Scene())), arm.configuration([0.0, 0.0]), np.zeros(2)
    monkeypatch.setattr(glfw, "init", lambda: False)
    with pytest.raises(DensarmError, match="needs a display"):
        plant.view()
    monkeypatch.setattr(glfw, "init", lambda: True)
    monkeypatch.setattr(mujoco.viewer, "launch_passive", lambda *_: window)
    plant.view()
    plant.step(q, zero, zero)
    assert window.shown == 1
