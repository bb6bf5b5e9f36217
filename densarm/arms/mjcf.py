"""An MJCF file to a RobotDescription: its arm as a URDF, which the models are built from."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from densarm.arms.description import RobotDescription
from densarm.arms.pose import Pose
from densarm.arms.urdf import Urdf
from densarm.errors import FileContentError
from densarm.scene.mjcf import (
    collides,
    compiled_mjcf,
    geom_label,
    jointed_bodies,
    require_mujoco,
    unsupported_geom,
)
from densarm.scene.obstacles import pose_fields
from densarm.values.arrays import Array

if TYPE_CHECKING:
    import mujoco

_DRAWN_GROUPS = 3  # the first ones, which MuJoCo's viewer shows
_UNLIMITED = 1e12  # of a slide, as URDFs of other makers write it
_GRAVITY = (0.0, 0.0, -9.81)  # [m/s²]


def mjcf_description(path: Path) -> RobotDescription:
    """Return the arm of an MJCF file: the trees of bodies that hinges and slides move.

    Bodies become links of the same names, with the masses that MuJoCo gives them; geoms that
    collide become collision shapes, and those that its viewer shows what is drawn; rotors
    (``armature``), damping and dry friction of joints are kept, as are keyframes (postures), sites
    (frames), coupled joints (as joints that mimic) and excluded pairs. Limits of torque are those
    of the joint (``actuatorfrcrange``), else of its actuators, the smaller of both directions.
    Positions are those of MuJoCo, from the same zero.

    Raises:
        FileContentError: it cannot be read, or has no joint, or one with an axis too many, or a
            shape that has no place, by its name and with what to do.
        DensarmError: MuJoCo is not installed.
    """
    return _Converter(path).description()


class _Converter:
    def __init__(self, path: Path) -> None:
        self._path, self._folder = path, path.resolve().parent
        spec, self._model = compiled_mjcf(path)
        self._mj = require_mujoco(str(path))
        self._meshes = {mesh.id: mesh for mesh in spec.meshes}
        self._kinds, self._joints = self._mj.mjtGeom, self._mj.mjtJoint
        self._bodies = jointed_bodies(self._model)
        if not self._bodies:
            raise FileContentError(path, "no joint moves a body: is it a scene, for load_scene?")
        model = self._model
        self._links = {0: "world"} | {
            b: str(model.body(b).name) or f"body_{b}" for b in self._bodies
        }
        self._joint_ids = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in self._links]
        self._names = {j: self._joint_name(j) for j in self._joint_ids}
        self._remarks: list[str] = []

    def description(self) -> RobotDescription:
        root = ElementTree.Element("robot", name=self._path.stem)
        ElementTree.SubElement(root, "link", name="world")
        for body in self._bodies:
            self._add_body(root, body)
        self._add_mimics(root)
        self._remark()
        made = RobotDescription(
            name=self._path.stem,
            urdf=_text(root),
            srdf=self._srdf(),
            frames=self._frames(),
            package_dirs=(str(self._folder),),
            remarks=self._remarks,
        )
        rotors = {name: float(self._of_dof("armature", j)) for j, name in self._names.items()}
        if not any(rotors.values()):
            return made
        order = list(Urdf(made).model.names)[1:]
        return replace(made, armature=[rotors[name] for name in order])

    def _joint_name(self, joint: int) -> str:
        own = f"{self._links[int(self._model.jnt_bodyid[joint])]}_joint"
        first = int(self._model.body_jntadr[self._model.jnt_bodyid[joint]])
        return str(self._model.joint(joint).name) or f"{own}{joint - first or ''}"

    def _of_dof(self, name: str, joint: int) -> float:
        return float(getattr(self._model, f"dof_{name}")[self._model.jnt_dofadr[joint]])

    def _add_body(self, root: ElementTree.Element, body: int) -> None:
        """Add a link and the joints that lead to it, about axes that need not meet."""
        model, link = self._model, self._links[body]
        parent, origin = self._links[int(model.body_parentid[body])], _placed(model, "body", body)
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        at = np.zeros(3)  # of the last joint, in the frame of the body
        for joint in range(first, first + count):
            origin = origin * pin.SE3(np.eye(3), model.jnt_pos[joint] - at)
            at = model.jnt_pos[joint]
            is_last = joint == first + count - 1 and not at.any()
            child = link if is_last else f"{link}@{self._names[joint]}"
            self._add_joint(root, joint, parent, child, origin)
            if not is_last:
                ElementTree.SubElement(root, "link", name=child)
            parent, origin = child, pin.SE3.Identity()
        if parent != link:
            origin = origin * pin.SE3(np.eye(3), -at)
            _add_jointed(root, f"{link}@{parent}", "fixed", parent, link, origin)
        element = ElementTree.SubElement(root, "link", name=link)
        self._add_inertial(element, body)
        geoms = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
        drawn = [g for g in geoms if model.geom_group[g] < _DRAWN_GROUPS]
        for geom in drawn or geoms:
            self._add_geom(element, "visual", geom)
        for geom in geoms:
            if collides(model, geom):
                self._add_geom(element, "collision", geom)

    def _add_joint(
        self, root: ElementTree.Element, joint: int, parent: str, child: str, origin: pin.SE3
    ) -> None:
        model, name = self._model, self._names[joint]
        kind = self._joints(int(model.jnt_type[joint]))
        if kind == self._joints.mjJNT_BALL:
            reason = f"joint {name!r} is a ball: make three hinges of it"
            raise FileContentError(self._path, reason)
        if kind == self._joints.mjJNT_FREE:
            _add_jointed(root, name, "floating", parent, child, origin)
            return
        # A body is where the file has it when its joints are at their references.
        axis, back = model.jnt_axis[joint], -self._reference(joint) * model.jnt_axis[joint]
        slides, is_limited = kind == self._joints.mjJNT_SLIDE, bool(model.jnt_limited[joint])
        origin = origin * (
            pin.SE3(np.eye(3), back) if slides else pin.SE3(pin.exp3(back), 0 * axis)
        )
        word = "prismatic" if slides else "revolute" if is_limited else "continuous"
        element = _add_jointed(root, name, word, parent, child, origin)
        ElementTree.SubElement(element, "axis", xyz=_words(axis))
        limit = {"effort": self._effort(joint), "velocity": 0.0}  # zero is none
        if word != "continuous":
            low, high = model.jnt_range[joint] if is_limited else (-_UNLIMITED, _UNLIMITED)
            limit |= {"lower": low, "upper": high}
        ElementTree.SubElement(element, "limit", _attributes(limit))
        friction = {key: self._of_dof(key, joint) for key in ("damping", "frictionloss")}
        friction["friction"] = friction.pop("frictionloss")
        ElementTree.SubElement(element, "dynamics", _attributes(friction))

    def _reference(self, joint: int) -> float:
        return float(self._model.qpos0[self._model.jnt_qposadr[joint]])

    def _effort(self, joint: int) -> float:
        """Return the torque or force limit of a joint, zero for none [N·m or N]."""
        model, total = self._model, 0.0
        if model.jnt_actfrclimited[joint]:
            return _smaller(model.jnt_actfrcrange[joint])
        for k in self._actuators(joint):
            gear = abs(float(model.actuator_gear[k, 0]))
            is_motor = not model.actuator_gaintype[k] and not model.actuator_biastype[k]
            if model.actuator_forcelimited[k]:
                total += gear * _smaller(model.actuator_forcerange[k])
            elif is_motor and model.actuator_ctrllimited[k]:
                gain = abs(float(model.actuator_gainprm[k, 0]))
                total += gear * gain * _smaller(model.actuator_ctrlrange[k])
            else:
                return 0.0
        return total

    def _actuators(self, joint: int) -> list[int]:
        """Return the actuators that drive a joint by itself."""
        at = self._mj.mjtTrn
        kinds = np.isin(self._model.actuator_trntype, [at.mjTRN_JOINT, at.mjTRN_JOINTINPARENT])
        return np.flatnonzero(kinds & (self._model.actuator_trnid[:, 0] == joint)).tolist()

    def _add_inertial(self, link: ElementTree.Element, body: int) -> None:
        model = self._model
        if not model.body_mass[body] > 0.0:
            return
        inertial = ElementTree.SubElement(link, "inertial")
        pose = pin.SE3(_rotation(model.body_iquat[body]), model.body_ipos[body])
        inertial.append(_origin(pose))
        ElementTree.SubElement(inertial, "mass", value=_words(model.body_mass[body]))
        moments = dict(zip(("ixx", "iyy", "izz"), model.body_inertia[body], strict=True))
        moments |= dict.fromkeys(("ixy", "ixz", "iyz"), 0.0)
        ElementTree.SubElement(inertial, "inertia", _attributes(moments))

    def _add_geom(self, link: ElementTree.Element, tag: str, geom: int) -> None:
        """Add what a geom is, drawn or to collide with; what can neither is refused or told."""
        model, kinds, size = self._model, self._kinds, self._model.geom_size[geom].tolist()
        kind, pose = kinds(int(model.geom_type[geom])), _placed(model, "geom", geom)
        if kind == kinds.mjGEOM_SPHERE:
            word, shape = "sphere", _attributes({"radius": size[0]})
        elif kind in (kinds.mjGEOM_CAPSULE, kinds.mjGEOM_CYLINDER):
            word = "capsule" if kind == kinds.mjGEOM_CAPSULE else "cylinder"
            shape = _attributes({"radius": size[0], "length": 2.0 * size[1]})
        elif kind == kinds.mjGEOM_BOX:
            word, shape = "box", {"size": _words([2.0 * side for side in size])}
        elif kind == kinds.mjGEOM_MESH:
            word, (shape, moved) = "mesh", self._mesh(geom)
            pose = pose * moved
        elif tag == "collision":
            raise unsupported_geom(self._path, model, geom)
        else:
            self._remarks.append(f"{geom_label(model, geom)} is drawn by MuJoCo alone: left out")
            return
        element = ElementTree.SubElement(link, tag)
        element.append(_origin(pose))
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), word, shape)
        if tag == "visual":
            skin = int(model.geom_matid[geom])
            colour = model.mat_rgba[skin] if skin >= 0 else model.geom_rgba[geom]
            material = ElementTree.SubElement(element, "material", name=f"geom_{geom}")
            ElementTree.SubElement(material, "color", rgba=_words(colour))

    def _mesh(self, geom: int) -> tuple[dict[str, str], pin.SE3]:
        """Return the file of a mesh and its scale, and where it is in the frame of the geom.

        MuJoCo moves vertices v into the principal frame of a mesh, in which a geom has it, by
        T⁻¹ S Rᵀ (v - p), p and R its ``refpos`` and ``refquat``, S its scale.
        """
        model, mesh = self._model, int(self._model.geom_dataid[geom])
        begin, name = int(model.mesh_pathadr[mesh]), model.mesh(mesh).name
        if begin < 0:
            reason = f"mesh {name!r} has no file: save it as OBJ or STL"
            raise FileContentError(self._path, reason)
        file = self._folder / model.paths[begin:].split(b"\0")[0].decode()
        own = file.relative_to(self._folder) if file.is_relative_to(self._folder) else file
        scale, refpos, refquat = model.mesh_scale[mesh], *self._references(mesh)
        if np.ptp(scale) > 0.0 and np.abs(refquat[1:]).any():
            reason = f"mesh {name!r} has refquat, and scales that differ: turn its geoms instead"
            raise FileContentError(self._path, reason)
        turn = _rotation(refquat).T
        kept = pin.SE3(turn, -scale * (turn @ refpos))
        principal = pin.SE3(_rotation(model.mesh_quat[mesh]), model.mesh_pos[mesh])
        return {"filename": str(own), "scale": _words(scale)}, principal.inverse() * kept

    def _references(self, mesh: int) -> tuple[Array, Array]:
        spec = self._meshes[mesh]
        return np.array(spec.refpos), np.array(spec.refquat)

    def _add_mimics(self, root: ElementTree.Element) -> None:
        """Let joints mimic others that an <equality> couples to them; tell of what it does else."""
        model, elements = self._model, {x.get("name"): x for x in root.findall("joint")}
        for k in np.flatnonzero(model.eq_active0).tolist():
            name, numbers = str(model.equality(k).name) or str(k), model.eq_data[k, :5]
            one, other = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            kind = self._mj.mjtEq(int(model.eq_type[k]))
            of_joints = kind == self._mj.mjtEq.mjEQ_JOINT
            if of_joints and {one, other} <= set(self._names) and not numbers[2:].any():
                offset = numbers[0] + self._reference(one) - numbers[1] * self._reference(other)
                mimic = {"joint": self._names[other]}
                mimic |= _attributes({"multiplier": numbers[1], "offset": offset})
                ElementTree.SubElement(elements[self._names[one]], "mimic", mimic)
            else:
                word = kind.name.removeprefix("mjEQ_").lower()
                hint = "lock the joints that it holds by locked_joints"
                self._remarks.append(f"equality {name!r} ({word}) is left out: {hint}")

    def _remark(self) -> None:
        """Tell of forces that no model of an arm has here."""
        model, names = self._model, self._names
        if not np.allclose(model.opt.gravity, _GRAVITY, atol=1e-3):
            told = _words(model.opt.gravity)
            self._remarks.append(f"gravity is {told} in the file, and 0 0 -9.81 here")
        springs = [names[j] for j in names if model.jnt_stiffness[j].any()]
        idle = [names[j] for j in names if model.jnt_type[j] and not self._drives(j)]
        lifted = [self._links[b] for b in self._bodies if model.body_gravcomp[b]]
        for found, what in (
            (springs, "springs of joints {} are left out"),
            (lifted, "gravcomp of bodies {} is left out: gravity acts on them"),
            (idle, "joints {} have no actuator of their own: taken as driven, without a limit"),
        ):
            if found:
                self._remarks.append(what.format(", ".join(found)))

    def _drives(self, joint: int) -> bool:
        return bool(self._actuators(joint)) or bool(self._model.jnt_actfrclimited[joint])

    def _srdf(self) -> str | None:
        """Return excluded pairs and keyframes as an SRDF has them, None where there are none."""
        model, root = self._model, ElementTree.Element("robot", name=self._path.stem)
        for signature in model.exclude_signature.tolist():
            one, other = signature >> 16, signature & 0xFFFF
            if {one, other} <= set(self._links):
                pair = {"link1": self._links[one], "link2": self._links[other]}
                ElementTree.SubElement(root, "disable_collisions", pair, reason="MJCF")
        for key in range(model.nkey):
            name = str(model.key(key).name) or f"key_{key}"
            state = ElementTree.SubElement(root, "group_state", name=name, group="MJCF")
            for joint in self._names:
                if model.jnt_type[joint] != self._joints.mjJNT_FREE:
                    at = model.key_qpos[key, model.jnt_qposadr[joint]]
                    told = {"name": self._names[joint], "value": _words(at)}
                    ElementTree.SubElement(state, "joint", told)
        return _text(root) if len(root) else None

    def _frames(self) -> dict[str, Pose]:
        """Return the sites of links, but for those named like a link or a joint."""
        model, frames = self._model, dict[str, Pose]()
        taken = {"universe", *self._links.values(), *self._names.values()}
        for site in range(model.nsite):
            name, body = str(model.site(site).name), int(model.site_bodyid[site])
            if name and name not in taken and body in self._links:
                frames[name] = Pose(self._links[body], **pose_fields(_placed(model, "site", site)))
        return frames


def _placed(model: mujoco.MjModel, kind: str, index: int) -> pin.SE3:
    """Return where a body, geom or site is in the frame of its parent."""
    place, turn = (getattr(model, f"{kind}_{key}")[index] for key in ("pos", "quat"))
    return pin.SE3(_rotation(turn), place)


def _rotation(wxyz: Array) -> Array:
    w, x, y, z = wxyz.tolist()
    return np.asarray(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix())


def _smaller(bounds: Array) -> float:
    """Return the smaller magnitude of a lower and an upper limit."""
    return float(np.abs(bounds).min())


def _add_jointed(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str, origin: pin.SE3
) -> ElementTree.Element:
    """Add a joint between two links to a URDF, and return it."""
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    joint.append(_origin(origin))
    return joint


def _origin(pose: pin.SE3) -> ElementTree.Element:
    turn = pin.rpy.matrixToRpy(pose.rotation)
    return ElementTree.Element("origin", xyz=_words(pose.translation), rpy=_words(turn))


def _words(numbers: Any) -> str:
    """Return numbers as text, to the last bit."""
    return " ".join(repr(float(x)) for x in np.ravel(numbers))


def _attributes(numbers: Mapping[str, float]) -> dict[str, str]:
    return {key: _words(x) for key, x in numbers.items()}


def _text(root: ElementTree.Element) -> str:
    return ElementTree.tostring(root, encoding="unicode")
