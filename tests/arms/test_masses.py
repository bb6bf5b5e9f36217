"""Links without a mass: the arm loads, what needs M says which, and shapes give what they would."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arms import catalogue
from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.arms.dynamics import holding_ratios
from densarm.control.controller import Gains
from densarm.control.regulation import DensityRegulation
from densarm.control.stopping import StopAndHold
from densarm.control.supervisor import Supervisor
from densarm.density.goal_distance import InertiaDistance
from densarm.errors import DensarmError, InvalidValueError, RobotDescriptionError
from densarm.scene.obstacles import Box
from densarm.scene.scene import Attachment, Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.simulate import simulate
from densarm.world.world import World

MASSLESS = Path(__file__).parents[1] / "data" / "massless.urdf"
TEXT = MASSLESS.read_text()
REST = np.zeros(2)
LOWER = '<box size="0.2 0.04 0.03"/>'
ZEROS = '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'

Solid = tuple[str, float, tuple[float, float, float]]


@pytest.fixture(scope="module")
def massless() -> Arm:
    return load_arm(MASSLESS)


def arm_of(text: str, **changes: Any) -> Arm:
    return Arm(RobotDescription(name="changed", urdf=text, **changes))


def lower_of(
    geometry: str, pose: str = "", density: float | None = None, *folders: str
) -> pin.Inertia:
    """The inertia that the last joint moves, with another geometry of its link."""
    old = '<origin xyz="0.1 0 0"/><geometry>' + LOWER
    assert old in TEXT
    text = TEXT.replace(old, f"<origin {pose}/><geometry>{geometry}")
    changed = arm_of(text, inertia="from_shapes", density=density, package_dirs=folders)
    return changed.model.inertias[2]


def test_it_loads_and_measures(massless: Arm) -> None:
    assert massless.links_without_mass == ("lower",)
    assert np.isinf(massless.limits.effort).all()
    assert (holding_ratios(massless, REST) == 0.0).all()
    world = World(massless, Scene())
    assert world.pairs == (("base_0", "lower_0"),)
    assert world.distances(REST)[0] == pytest.approx(np.hypot(0.25, 0.335), rel=1e-6)


NEEDS_MASSES: dict[str, Callable[[Arm], object]] = {
    "M": lambda arm: arm.mass_matrix(REST),
    "H": lambda arm: arm.nonlinear_effects(REST, REST),
    "V of the inertia": lambda arm: InertiaDistance(arm, REST),
    "plant": PinocchioPlant,
    "stop and hold": lambda arm: StopAndHold(arm, Gains(), 0.001),
    "supervisor": lambda arm: Supervisor(arm, None, tolerances=None),  # type: ignore[arg-type]
    "torque": lambda arm: DensityRegulation(World(arm, Scene()), REST).torque(0.0, REST, REST),
    "plain form": lambda arm: DensityRegulation(World(arm, Scene()), REST, plain=True),
    "loop": lambda arm: simulate(
        World(arm, Scene()), DensityRegulation(World(arm, Scene()), REST), REST
    ),
}


@pytest.mark.parametrize("what", NEEDS_MASSES)
def test_what_needs_masses_says_which_and_the_ways_out(massless: Arm, what: str) -> None:
    both = r"none of link 'lower': .*inertia = 'from_shapes'.*velocities.*SingleIntegrator"
    with pytest.raises(RobotDescriptionError, match=both) as raised:
        NEEDS_MASSES[what](massless)
    assert "\n" not in str(raised.value)
    NEEDS_MASSES[what](load_arm(MASSLESS, inertia="from_shapes"))


def test_all_links_without_a_mass_are_told() -> None:
    bare = re.sub(r"<inertial>.*</inertial>", "", TEXT)
    assert arm_of(bare).links_without_mass == ("upper", "lower")
    with pytest.raises(RobotDescriptionError, match=r"none of link 'upper', 'lower':"):
        arm_of(bare).mass_matrix(REST)
    assert arm_of(bare, inertia="from_shapes").links_without_mass == ()


def test_an_inertial_of_zeros_is_none() -> None:
    text = TEXT.replace('<link name="lower">', f'<link name="lower">{ZEROS}</inertial>')
    assert arm_of(text).links_without_mass == ("lower",)
    assert arm_of(text, inertia="from_shapes").model.inertias[2].mass == pytest.approx(0.24)


def test_of_two_joints_on_one_axis_the_first_needs_a_mass_of_its_own() -> None:
    inertial = re.findall(r"<inertial>.*</inertial>", TEXT)[0]
    text = TEXT.replace(inertial, "").replace(
        '<link name="lower">', f'<link name="lower">{inertial}'
    )
    assert arm_of(text).links_without_mass == ()
    assert arm_of(text.replace("0.3 0 0.2", "0 0 0.2")).links_without_mass == ("upper",)


def test_a_link_welded_to_a_massive_one_needs_none() -> None:
    weld = '<joint name="weld" type="fixed"><parent link="upper"/><child link="tool"/></joint>'
    text = TEXT.replace("</robot>", f'<link name="tool"/>{weld}</robot>')
    assert arm_of(text).links_without_mass == ("lower",)


def test_a_link_without_shapes_gets_no_mass_from_them() -> None:
    text = re.sub(rf"<collision><origin[^>]*><geometry>{LOWER}.*", "", TEXT)
    arm = arm_of(text, inertia="from_shapes")
    with pytest.raises(RobotDescriptionError, match=r"'lower'.*or a collision shape to compute"):
        arm.mass_matrix(REST)


def test_links_that_have_a_mass_keep_it(massless: Arm) -> None:
    arm = load_arm(MASSLESS, inertia="from_shapes")
    assert arm.model.inertias[1] == massless.model.inertias[1]
    assert np.array_equal(arm.limits.effort, [10.0, 10.0])
    whole = load_arm("panda")
    same = load_arm("panda", inertia="from_shapes")
    assert whole.links_without_mass == ()
    assert list(same.model.inertias) == list(whole.model.inertias)


def box_of(x: float, y: float, z: float) -> Solid:
    volume = x * y * z
    moments = volume / 12.0 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    return f'<box size="{x!r} {y!r} {z!r}"/>', volume, tuple(moments)


def sphere_of(r: float) -> Solid:
    volume = 4.0 / 3.0 * np.pi * r**3
    return f'<sphere radius="{r!r}"/>', volume, (0.4 * volume * r**2,) * 3


def cylinder_of(r: float, h: float) -> Solid:
    volume = np.pi * r**2 * h
    across = volume * (r**2 / 4.0 + h**2 / 12.0)
    shape = f'<cylinder radius="{r!r}" length="{h!r}"/>'
    return shape, volume, (across, across, 0.5 * volume * r**2)


def capsule_of(r: float, h: float) -> Solid:
    """A cylinder and two half balls, each with its centre of mass 3r/8 beyond the end."""
    (_, barrel, turning), (_, ball, _) = cylinder_of(r, h), sphere_of(r)
    across = turning[0] + ball * (0.4 * r**2 + h**2 / 4.0 + 3.0 * h * r / 8.0)
    along = turning[2] + 0.4 * ball * r**2
    shape = f'<capsule radius="{r!r}" length="{h!r}"/>'
    return shape, barrel + ball, (across, across, along)


SIZE = st.floats(0.01, 1.0)
SOLIDS = st.one_of(
    st.builds(box_of, SIZE, SIZE, SIZE),
    st.builds(sphere_of, SIZE),
    st.builds(cylinder_of, SIZE, SIZE),
    st.builds(capsule_of, SIZE, SIZE),
)
THREE = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


@given(solid=SOLIDS, density=st.floats(1.0, 20_000.0), xyz=THREE, rpy=THREE)
def test_masses_from_shapes_are_the_closed_forms(
    solid: Solid, density: float, xyz: tuple[float, ...], rpy: tuple[float, ...]
) -> None:
    geometry, volume, moments = solid
    pose = f'xyz="{" ".join(map(repr, xyz))}" rpy="{" ".join(map(repr, rpy))}"'
    found = lower_of(geometry, pose, density)
    turn = pin.rpy.rpyToMatrix(*rpy)
    assert found.mass == pytest.approx(density * volume, rel=1e-9)
    np.testing.assert_allclose(found.lever, xyz, atol=1e-9)
    expected = density * turn @ np.diag(moments) @ turn.T
    np.testing.assert_allclose(found.inertia, expected, atol=1e-9 * np.abs(expected).max())


def test_a_mesh_counts_as_its_hull(tmp_path: Path) -> None:
    sides = np.array([0.3, 0.2, 0.1])
    corners = sides * (np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T - 0.5)
    faces = [(1, 2, 3), (2, 3, 4), (5, 6, 7), (6, 7, 8), (1, 2, 5), (2, 5, 6), (3, 4, 7)]
    lines = ["v " + " ".join(map(str, corner)) for corner in corners]
    lines += ["f " + " ".join(map(str, face)) for face in [*faces, (4, 7, 8), (1, 3, 5)]]
    file = tmp_path / "box.obj"
    file.write_text("\n".join([*lines, "f 3 5 7"]))  # one side is open
    found = lower_of('<mesh filename="box.obj" scale="1 2 1"/>', "", None, str(tmp_path))
    _, volume, moments = box_of(0.3, 0.4, 0.1)
    assert found.mass == pytest.approx(1000.0 * volume)
    np.testing.assert_allclose(found.inertia, 1000.0 * np.diag(moments), atol=1e-6)
    assert np.abs(found.lever).max() < 1e-12


def test_a_cylinder_with_balls_on_its_ends_counts_once() -> None:
    radius, length = 0.05, 0.3
    ball = sphere_of(radius)[0]
    ends = [f'<origin xyz="0 0 {z}"/><geometry>{ball}' for z in (-length / 2, length / 2)]
    parts = "</geometry></collision><collision>".join([cylinder_of(radius, length)[0], *ends])
    _, volume, moments = capsule_of(radius, length)
    found = lower_of(parts)
    assert found.mass == pytest.approx(1000.0 * volume)
    np.testing.assert_allclose(found.inertia.diagonal(), 1000.0 * np.array(moments))


@pytest.mark.parametrize("shapes", ["hull", "capsule"])
def test_what_distances_are_measured_to_changes_no_mass(shapes: str) -> None:
    arm = load_arm(MASSLESS, inertia="from_shapes", shapes=shapes)
    assert arm.model.inertias[2].mass == pytest.approx(0.24)


def test_a_locked_link_counts_with_what_it_is_locked_to(massless: Arm) -> None:
    whole = load_arm(MASSLESS, inertia="from_shapes")
    locked = load_arm(MASSLESS, locked_joints={"second": 0.7}, inertia="from_shapes")
    place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.7), np.array([0.3, 0.0, 0.2]))
    expected = whole.model.inertias[1] + place.act(whole.model.inertias[2])
    np.testing.assert_allclose(locked.model.inertias[1].toDynamicParameters(),
                               expected.toDynamicParameters(), atol=1e-12)  # fmt: skip
    assert load_arm(MASSLESS, locked_joints={"second": 0.7}).links_without_mass == ()
    assert massless.links_without_mass == ("lower",)


def test_a_held_body_is_no_mass_of_the_link(massless: Arm) -> None:
    box = Box(name="held", size=[0.1, 0.1, 0.1], position=[0.2, 0.0, 0.0])
    held = Attachment(box, "lower", mass=1.0)
    assert massless.holding(held).links_without_mass == ("lower",)


def test_it_is_rebuilt_from_json() -> None:
    arm = load_arm(MASSLESS, inertia="from_shapes", density=500.0)
    again = Arm(RobotDescription.from_json(json.loads(json.dumps(arm.description.to_json()))))
    assert again.model.inertias[2] == arm.model.inertias[2]
    assert arm.model.inertias[2].mass == pytest.approx(0.12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inertia": "guess"}, r"^inertia = 'guess': must be one of from_shapes, given"),
        ({"density": 500.0}, r"^density = 500.0: must be with inertia = 'from_shapes' only"),
        (
            {"inertia": "from_shapes", "density": 0.0},
            r"^density = 0.0: must be a finite number > 0",
        ),
    ],
)
def test_values_that_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        load_arm(MASSLESS, **changes)


def test_a_named_robot_may_have_its_masses_from_shapes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "robot.urdf").write_text(TEXT)
    entry = 'urdf = "robot.urdf"\ninertia = "from_shapes"\ndensity = 2000.0\n'
    (tmp_path / "own" / "arm.toml").write_text(entry)
    monkeypatch.setattr(catalogue, "robots_folder", lambda: tmp_path)
    assert load_arm("own").model.inertias[2].mass == pytest.approx(0.48)


def test_a_wrong_inertia_is_refused_still() -> None:
    text = TEXT.replace('izz="0.1"', 'izz="-0.1"')
    with pytest.raises(DensarmError, match=r"joint 'first' moves an inertia that is not positive"):
        arm_of(text)
