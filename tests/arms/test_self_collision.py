"""Which links of an arm are checked against each other."""

from pathlib import Path

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.arms.self_collision import Exclusion

DATA = Path(__file__).parents[1] / "data"


def named_pairs(arm: Arm) -> set[frozenset[str]]:
    names = [item.name for item in arm.collision_model.geometryObjects]
    pairs = arm.collision_model.collisionPairs
    return {frozenset((names[pair.first], names[pair.second])) for pair in pairs}


def expected(*pairs: tuple[str, str]) -> set[frozenset[str]]:
    return {frozenset(f"{link}_0" for link in pair) for pair in pairs}


APART = (
    ("base", "carriage"),
    ("base", "left_arm"),
    ("base", "right_arm"),
    ("base", "blade"),
    ("column", "left_arm"),
    ("column", "right_arm"),
    ("column", "blade"),
    ("carriage", "blade"),
    ("left_arm", "blade"),
)


def left_out(arm: Arm, reason: Exclusion) -> set[frozenset[str]]:
    return {frozenset(pair.shapes) for pair in arm.excluded_pairs if pair.reason == reason}


def test_neighbours_are_left_out() -> None:
    arm = load_arm(DATA / "branching.urdf")
    assert named_pairs(arm) == expected(*APART, ("left_arm", "right_arm"))
    assert expected(("base", "column"), ("right_arm", "blade")) < left_out(
        arm, Exclusion.NEIGHBOURS
    )


def test_srdf_disables_pairs() -> None:
    arm = load_arm(DATA / "branching.urdf", srdf=DATA / "branching.srdf")
    assert named_pairs(arm) == expected(*APART)
    assert left_out(arm, Exclusion.SRDF) == expected(("left_arm", "right_arm"))


def with_srdf(*entries: str) -> Arm:
    urdf = (DATA / "branching.urdf").read_text()
    srdf = f'<robot name="branching">{"".join(entries)}</robot>'
    return Arm(RobotDescription("it", urdf, srdf=srdf, package_dirs=(str(DATA),)))


def test_srdf_with_links_that_the_urdf_lacks() -> None:
    arm = with_srdf(
        '<disable_collisions link1="left_arm" link2="right_arm"/>',
        '<disable_collisions link1="base" link2="tail"/>',
    )
    assert named_pairs(arm) == expected(*APART)
    assert arm.remarks == ("SRDF: no link 'tail': its pairs are ignored",)


def test_srdf_disables_links_and_enables_pairs() -> None:
    default = '<disable_default_collisions link="left_arm"/>'
    alone = {pair for pair in APART if "left_arm" not in pair}
    arm = with_srdf(default)
    assert named_pairs(arm) == expected(*alone)
    assert expected(("left_arm", "right_arm"), ("base", "left_arm")) <= left_out(
        arm, Exclusion.SRDF
    )
    enable = '<enable_collisions link1="{}" link2="{}"/>'
    again = with_srdf(
        default,
        enable.format("left_arm", "base"),
        enable.format("left_arm", "blade"),
        enable.format("base", "column"),
        '<disable_collisions link1="blade" link2="left_arm"/>',
    )
    # Neighbours too are checked on demand; what is disabled by name stays so.
    assert named_pairs(again) == expected(*alone, ("base", "left_arm"), ("base", "column"))


def test_panda_srdf_leaves_pairs_that_can_collide() -> None:
    pairs = named_pairs(load_arm("panda"))
    assert expected(("panda_link0", "panda_hand"), ("panda_link2", "panda_hand")) <= pairs
    assert not expected(("panda_link6", "panda_hand")) & pairs


INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def arm_with_collar(radius: float) -> Arm:
    """Three links in a row, the last one with a ball around its joint."""
    links = ["base", "one", "two", "three"]
    body = "".join(
        f'<link name="{link}">{INERTIAL}<collision><geometry><sphere radius="{size}"/></geometry>'
        "</collision></link>"
        for link, size in zip(links, [0.1, 0.1, 0.1, radius], strict=True)
    )
    body += "".join(
        f'<joint name="j{k}" type="revolute"><origin xyz="0.5 0 0"/><parent link="{links[k]}"/>'
        f'<child link="{links[k + 1]}"/><axis xyz="0 0 1"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        for k in range(3)
    )
    return Arm(RobotDescription(name="row", urdf=f'<robot name="row">{body}</robot>'))


def test_pairs_that_always_collide_are_left_out() -> None:
    # one and three are 1 m apart at most, base and three 1.5 m.
    assert named_pairs(arm_with_collar(0.1)) == expected(
        ("base", "two"), ("base", "three"), ("one", "three")
    )
    collared = arm_with_collar(0.95)
    assert named_pairs(collared) == expected(("base", "two"), ("base", "three"))
    assert left_out(collared, Exclusion.ALWAYS) == expected(("one", "three"))
    assert named_pairs(arm_with_collar(0.85)) == named_pairs(arm_with_collar(0.1))


def row_with_hidden_link(length: float, kind: str = "revolute") -> Arm:
    """Three balls in a row, a link without shapes before the last one."""
    names = ["base", "one", "hidden", "two"]
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    body = "".join(f'<link name="{n}">{INERTIAL}{ball * (n != "hidden")}</link>' for n in names)
    for k, (way, form) in enumerate([(0.5, "revolute"), (0.5, "revolute"), (length, kind)]):
        body += (
            f'<joint name="j{k}" type="{form}"><origin xyz="{way} 0 0"/><parent link="{names[k]}"/>'
            f'<child link="{names[k + 1]}"/><axis xyz="0 0 1"/>'
            '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        )
    return Arm(RobotDescription(name="row", urdf=f'<robot name="row">{body}</robot>'))


def test_neighbours_around_a_joint_of_several_axes() -> None:
    """Links around one that is long, or slides, can meet: they stay checked."""
    apart = expected(("base", "two"))
    assert named_pairs(row_with_hidden_link(0.01)) == apart
    assert left_out(row_with_hidden_link(0.01), Exclusion.NEIGHBOURS) >= expected(("one", "two"))
    also = apart | expected(("one", "two"))
    assert named_pairs(row_with_hidden_link(0.3)) == also
    assert named_pairs(row_with_hidden_link(0.0, "prismatic")) == also


def test_of_links_fixed_to_each_other_the_nearest_alone_are_neighbours() -> None:
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    urdf = '<robot name="mast"><link name="plate"/>' + "".join(
        f'<link name="{link}">{INERTIAL}{"" if link == "flange" else ball}</link>'
        for link in ("base", "mast", "flange", "one", "two")
    )
    for name, parent, child, kind in (
        ("foot", "plate", "base", "fixed"),
        ("stay", "plate", "mast", "fixed"),
        ("top", "base", "flange", "fixed"),  # has no geometry: the base is nearest
        ("j1", "flange", "one", "revolute"),
        ("j2", "one", "two", "revolute"),
    ):
        urdf += (
            f'<joint name="{name}" type="{kind}"><origin xyz="0.5 0 0"/><parent link="{parent}"/>'
            f'<child link="{child}"/><axis xyz="0 0 1"/>'
            '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        )
    arm = Arm(RobotDescription(name="mast", urdf=urdf + "</robot>"))
    assert named_pairs(arm) == expected(("base", "two"), ("mast", "one"), ("mast", "two"))


@pytest.mark.parametrize("limit", ["1e15", "1.7e308"])
def test_wide_limits(limit: str) -> None:
    urdf = (DATA / "branching.urdf").read_text()
    urdf = urdf.replace('lower="-2" upper="1.5"', f'lower="-{limit}" upper="{limit}"')
    description = RobotDescription(name="wide", urdf=urdf, package_dirs=(str(DATA),))
    assert named_pairs(Arm(description)) == expected(*APART, ("left_arm", "right_arm"))


def test_the_global_random_state_is_left_alone() -> None:
    np.random.seed(0)  # noqa: NPY002
    expected_number = np.random.random()  # noqa: NPY002
    np.random.seed(0)  # noqa: NPY002
    load_arm("two_link")
    assert np.random.random() == expected_number  # noqa: NPY002
