"""Taking parts off a robot, a gripper say, at the joints that carry them."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import replace

from densarm.errors import UnknownNameError
from densarm.robot.robot_description import RobotDescription, parse_robot_xml
from densarm.robot.robot_models import joint_names


def without_subtrees(description: RobotDescription, joints: Iterable[str]) -> RobotDescription:
    """Return a robot without some joints and all that they carry.

    What the description says of the links and joints that go, goes too; an end effector among them
    becomes the last link.

    Args:
        description: the whole robot.
        joints: names of joints of any type, fixed ones included.

    Raises:
        RobotDescriptionError: the URDF or SRDF cannot be used.
        UnknownNameError: a joint that the URDF does not have.
    """
    root = parse_robot_xml(description.urdf, "URDF")
    whole = _names(root, "link")
    before = joint_names(description)
    _cut(root, joints)
    kept_links, kept_joints = _names(root, "link"), _names(root, "joint")
    srdf, end, given = description.srdf, description.end_effector, description.acceleration
    kept = [i for i, name in enumerate(before) if name in kept_joints]
    return replace(
        description,
        urdf=ElementTree.tostring(root, encoding="unicode"),
        srdf=None if srdf is None else _without_pairs(srdf, whole - kept_links),
        locked_joints={j: x for j, x in description.locked_joints.items() if j in kept_joints},
        end_effector=end if end in kept_links | kept_joints else None,
        acceleration=None if given is None else tuple(given[i] for i in kept),
        postures={
            key: tuple(angles[i] for i in kept) for key, angles in description.postures.items()
        },
    )


def _names(root: ElementTree.Element, kind: str) -> set[str]:
    return {element.get("name", "") for element in root.findall(kind)}


def _cut(root: ElementTree.Element, joints: Iterable[str]) -> None:
    """Take joints and what they carry out of a URDF."""
    known = {joint.get("name", ""): joint for joint in root.findall("joint")}
    links = {link.get("name", ""): link for link in root.findall("link")}
    waiting = list(joints)
    while waiting:
        name = waiting.pop()
        if name not in known:
            raise UnknownNameError("joint to cut at", name, known)
        child = _end(known[name], "child")
        waiting += [j for j, joint in known.items() if _end(joint, "parent") == child]
        for element in (known[name], links.get(child)):
            if element is not None and element in root:
                root.remove(element)


def _end(joint: ElementTree.Element, kind: str) -> str:
    end = joint.find(kind)
    return "" if end is None else end.get("link", "")


def _without_pairs(srdf: str, links: set[str]) -> str:
    root = parse_robot_xml(srdf, "SRDF")
    for pair in root.findall("disable_collisions"):
        if {pair.get("link1"), pair.get("link2")} & links:
            root.remove(pair)
    return ElementTree.tostring(root, encoding="unicode")
