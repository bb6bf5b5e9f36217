"""Arm: Pinocchio's model of a robot arm, its geometry, limits and named postures."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.arms.catalogue import robot_description
from densarm.arms.description import RobotDescription
from densarm.arms.joints import (
    JointLimits,
    joint_limits,
    only_joints,
    rotor_inertia,
    without_joints,
    without_subtrees,
)
from densarm.arms.models import build_models, build_visual_model, frame_index
from densarm.arms.pose import Pose
from densarm.arms.self_collision import ExcludedPair, srdf_postures
from densarm.errors import InvalidValueError, RobotDescriptionError
from densarm.scene.scene import Attachment
from densarm.values.arrays import Array, Vector
from densarm.values.checks import finite_vector
from densarm.values.files import read_text

_NEUTRAL_MARGIN = 0.1  # share of a joint's range that the neutral posture keeps from each limit
_FARTHEST = 1e6  # [rad or m], stands for no limit


class Arm:
    """A robot arm: a chain or tree of revolute, continuous and prismatic joints.

    `postures` are those that the robot comes with, and ``neutral`` where it touches nothing: every
    joint at zero, or as near to it as a tenth of its range from the limits allows.

    Args:
        description: URDF, SRDF and what else the models are built from.

    Raises:
        RobotDescriptionError: the description cannot be used, with the reason.
    """

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        self.name = description.name
        models = build_models(description)
        self.model, self.collision_model = models.model, models.collision
        self.model.armature = rotor_inertia(self.model, description)
        self._mesh_files = models.mesh_files
        self.origin: Array = models.origin
        """Point of the world that is the origin of the models (3,) [m].

        It is the world's own, or the first joint's place if that is more than 10 m away from it.
        """
        self.excluded_pairs: tuple[ExcludedPair, ...] = models.excluded_pairs
        """Shapes that are not checked against each other though they move so, and why."""
        self.self_pieces: frozenset[str] = models.self_pieces
        """Names of pieces that stand for their link in self-collision pairs alone.

        They lie in its hull, which obstacles and held bodies are checked against.
        """
        self.links_without_collision: tuple[str, ...] = models.links_without_collision
        """Links that the URDF draws and gives no collision geometry.

        They collide as drawn, or not at all if `collision_from_visual` is "never".
        """
        self.remarks: tuple[str, ...] = models.remarks
        """What was taken otherwise than URDF and SRDF have it, one phrase each.

        Collision shapes without any size are left out, flat ones made 1 mm thick, and pairs of
        links that the URDF lacks ignored.
        """
        self.links_without_mass: tuple[str, ...] = models.links_without_mass
        """Links that joints move without any mass, if M is singular: nothing tells torques then."""
        self.data = self.model.createData()
        self.nq: int = self.model.nq
        self.nv: int = self.model.nv
        joints = list(self.model.joints)[1:]
        self.joint_names: tuple[str, ...] = tuple(self.model.names)[1:]
        self.idx_q: NDArray[np.int64] = np.array([joint.idx_q for joint in joints])
        self.continuous: NDArray[np.bool_] = np.array([joint.nq == 2 for joint in joints])
        self.joint_index: NDArray[np.int64] = np.array([self.idx_q, self.continuous], np.int64)
        """First index of each joint in a configuration, and 1 where it is continuous (2, nv)."""
        self._continuous: list[int] = np.flatnonzero(self.continuous).tolist()
        self.limits: JointLimits = joint_limits(
            self.model, description, has_masses=not self.links_without_mass
        )
        self.end_effector_frame = frame_index(
            self.model, description.end_effector, "end-effector frame"
        )
        self.end_effector: str = self.model.frames[self.end_effector_frame].name
        self.postures: dict[str, Array] = self._postures()

    def __repr__(self) -> str:
        holding = "".join(f", holding {item.body.name}" for item in self.description.attachments)
        return f"Arm({self.name!r}, {self.nv} joint{'s' * (self.nv != 1)}{holding})"

    @cached_property
    def visual_model(self) -> pin.GeometryModel:
        """Pinocchio's visual geometry, loaded when first asked for."""
        return build_visual_model(self.description)

    def holding(self, *attachments: Attachment) -> "Arm":
        """Return the same arm with bodies fixed to its links.

        Their shapes join its collision and visual geometry and their inertia its model, so that
        clearance, certificates, dynamics, pictures and recordings take them for parts of the arm.

        Args:
            attachments: the bodies, the links that hold them and their masses.

        Raises:
            UnknownNameError: a link that the arm does not have.
            InvalidValueError: a body is named like a shape of the arm or another body.
        """
        held = (*self.description.attachments, *attachments)
        return Arm(replace(self.description, attachments=held)) if attachments else self

    def mesh_hashes(self) -> dict[str, str]:
        """Return the SHA-256 of each collision mesh file, by its path from their common folder."""
        files = self._mesh_files.items()
        return {name: sha256(file.read_bytes()).hexdigest() for name, file in files}

    def configuration(self, angles: ArrayLike) -> Array:
        """Return the configuration q of joint positions.

        Args:
            angles: (nv,) one number per joint [rad or m].

        Returns:
            q (nq,): a continuous joint takes (cos, sin), any other its number.

        Raises:
            InvalidValueError: a wrong length, or an entry that is not finite.
        """
        return self.configurations(finite_vector("angles", angles, self.nv))

    def configurations(self, angles: Array) -> Array:
        """Return the configurations (..., nq) of joint positions (..., nv), without checks."""
        if not self._continuous:
            return angles.copy()
        q = np.empty((*angles.shape[:-1], self.nq))
        q[..., self.idx_q] = angles
        for joint in self._continuous:
            at, angle = self.idx_q[joint], angles[..., joint]
            q[..., at], q[..., at + 1] = np.cos(angle), np.sin(angle)
        return q

    def angles(self, q: ArrayLike) -> Array:
        """Return joint positions (..., nv) of configurations q (..., nq) [rad or m].

        A continuous joint's angle lies in (-pi, pi].
        """
        if not self._continuous:
            return np.array(q, dtype=np.float64)
        q = np.asarray(q, dtype=np.float64)
        theta = q.take(self.idx_q, axis=-1)
        for joint in self._continuous:
            at = self.idx_q[joint]
            theta[..., joint] = np.arctan2(q[..., at + 1], q[..., at])
        return theta

    def check_configuration(self, name: str, q: ArrayLike) -> Array:
        """Return q as a float array (nq,).

        Args:
            name: how errors call it.
            q: a configuration.

        Raises:
            InvalidValueError: a wrong length, an entry that is not finite, or a (cos, sin) pair
                of a continuous joint that is not of length one.
        """
        hint = "" if self.nq == self.nv else " (from one number per joint: arm.configuration)"
        vector = finite_vector(name, q, self.nq, hint)
        for joint in self._continuous:
            pair = vector[self.idx_q[joint] : self.idx_q[joint] + 2]
            if abs(np.hypot(*pair) - 1.0) > 1e-6:
                raise InvalidValueError(
                    f"{name} of joint {self.joint_names[joint]!r}", pair.tolist(), "(cos, sin)"
                )
        return vector

    def pose(self, q: ArrayLike, frame: str | None = None) -> Pose:
        """Return where a frame is, by its name or the end effector's, at a configuration (nq,)."""
        at = frame_index(self.model, frame or self.end_effector)
        pin.forwardKinematics(self.model, self.data, self.check_configuration("configuration", q))
        pose = pin.SE3ToXYZQUAT(pin.updateFramePlacement(self.model, self.data, at))
        return Pose(frame or self.end_effector, pose[:3] + self.origin, pose[3:])

    def difference(self, q_from: Array, q_to: Array) -> Array:
        """Return the tangent vector (..., nv) that leads from one configuration to another.

        Args:
            q_from: (..., nq).
            q_to: (..., nq).

        Returns:
            q_to ⊖ q_from [rad or m]; the short way round on continuous joints.
        """
        delta = self.angles(q_to) - self.angles(q_from) if self._continuous else q_to - q_from
        for joint in self._continuous:
            turn = delta[..., joint]
            delta[..., joint] = np.arctan2(np.sin(turn), np.cos(turn))
        return delta

    def unwrapped(self, q: Array) -> Array:
        """Return joint positions (N, nv) along configurations (N, nq), on whole turns too."""
        turned = np.cumsum(self.difference(q[:-1], q[1:]), axis=0)
        return np.asarray(self.angles(q[0]) + np.vstack([np.zeros(self.nv), turned]))

    def integrate(self, q: Array, step: Array) -> Array:
        """Return q ⊕ step: the configurations (..., nq) that tangent vectors lead to.

        Args:
            q: (..., nq).
            step: (..., nv) [rad or m].
        """
        return self.configurations(self.angles(q) + step)

    def require_masses(self, what: str) -> None:
        """Refuse an arm without the masses that something needs.

        Args:
            what: needs them, as an error begins.

        Raises:
            RobotDescriptionError: `links_without_mass`, how to give them one, or do without.
        """
        if not self.links_without_mass:
            return
        mend = "load the arm with inertia = 'from_shapes'"
        if self.description.inertia == "from_shapes":
            mend = "or a collision shape to compute one from"
        raise RobotDescriptionError(
            f"robot {self.name!r}: {what} needs masses, and there is none of link "
            f"{', '.join(map(repr, self.links_without_mass))}: give an <inertial>, {mend}, or "
            "command velocities (control.form = 'velocity', in Python plant=SingleIntegrator(arm))"
        )

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return the joint-space inertia matrix M(q).

        Args:
            q: (nq,).

        Returns:
            M (nv, nv), symmetric [kg·m² for revolute joints].

        Raises:
            RobotDescriptionError: the arm has `links_without_mass`.
        """
        self.require_masses("the mass matrix")
        q = self.check_configuration("configuration", q)
        upper = np.triu(pin.crba(self.model, self.data, q))
        return np.asarray(upper + np.triu(upper, 1).T)

    def nonlinear_effects(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return H(q, v), the Coriolis, centrifugal and gravity torques.

        Args:
            q: (nq,).
            v: (nv,) [rad/s or m/s].

        Returns:
            H (nv,) [N·m or N], so that M(q) a + H(q, v) = tau.

        Raises:
            RobotDescriptionError: the arm has `links_without_mass`.
        """
        self.require_masses("torque")
        q = self.check_configuration("configuration", q)
        v = finite_vector("velocity", v, self.nv)
        return np.array(pin.nonLinearEffects(self.model, self.data, q, v))

    def _postures(self) -> dict[str, Array]:
        postures: dict[str, Array] = {}
        for name, positions in srdf_postures(self.description.srdf).items():
            if set(self.joint_names) <= set(positions):
                postures[name] = self.configuration([positions[j] for j in self.joint_names])
        for name, angles in self.description.postures.items():
            postures[name] = self.configuration(angles)
        lower, upper = np.clip([self.limits.lower, self.limits.upper], -_FARTHEST, _FARTHEST)
        margin = _NEUTRAL_MARGIN * (upper - lower)
        neutral = self.configuration(np.clip(0.0, lower + margin, upper - margin))
        shapes = self.collision_model
        touches_itself = pin.computeCollisions(
            self.model, self.data, shapes, shapes.createData(), neutral, True
        )
        return postures if touches_itself else {"neutral": neutral, **postures}


def load_arm(
    robot: str | Path,
    *,
    srdf: str | Path | None = None,
    package_dirs: Iterable[str | Path] = (),
    joints: Iterable[str] | None = None,
    locked_joints: Mapping[str, float] | None = None,
    cut_joints: Iterable[str] = (),
    base_placement: pin.SE3 | None = None,
    shapes: str | None = None,
    collision_from_visual: str | None = None,
    inertia: str | None = None,
    density: float | None = None,
    acceleration: Vector | None = None,
    torque_rate: Vector | float | None = None,
    jerk: Vector | float | None = None,
    armature: Vector | float | None = None,
    frames: Mapping[str, Pose] | None = None,
) -> Arm:
    """Load an arm by name, or from a URDF or MJCF file.

    Joints that mimic locked ones are locked with them. `Arm.remarks` tells what of the files was
    not taken as it stands.

    Args:
        robot: a known name (``densarm list``), or the path of a URDF, or of an MJCF, whose bodies
            are links here.
        srdf: path of an SRDF, for disabled pairs and postures.
        package_dirs: folders that ``package://`` paths of meshes start from; the URDF's own
            folder and those above it are searched too.
        joints: exact URDF names of the joints that make the arm, in any order: all others are
            locked, at zero or at the limit next to it; None for every joint.
        locked_joints: exact URDF joint name to position [rad or m], which may lie outside limits.
        cut_joints: exact URDF names of joints, fixed ones too, that are taken off the arm with all
            that they carry, e.g. a gripper.
        base_placement: pose of the base in the world; gravity and obstacles stay.
        shapes: "hull" for the convex hulls of the collision geometry, but in convex pieces for
            those pairs of links whose hulls overlap, in some of 5,000 random configurations, where
            their meshes are 4 mm apart, as far as some seconds of work go; "pieces" for pieces in
            all pairs, of every link whose hull is much larger than its mesh; or "capsule" for the
            smallest capsule around each hull: larger, but distances cost less. Each encloses the
            meshes. Pieces are made once on a machine. Pairs that always collide are left out in
            either. None for "hull", unless a known robot needs another.
        collision_from_visual: which links collide as they are drawn: "missing" for those without
            collision geometry, "always" for all that are drawn, or "never"; None for "missing",
            unless a known robot needs another. `Arm.links_without_collision` names those concerned.
        inertia: "from_shapes" gives links without an <inertial>, or with one of zeros, that of
            their collision shapes, of one density; "given" leaves them massless. None for "given",
            unless a known robot needs another. An arm with `Arm.links_without_mass` is planned for
            and moved by velocities only.
        density: of masses from shapes [kg/m³]; None for 1000, or a known robot's own.
        acceleration: limits of the arm's joints (nv,) [rad/s² or m/s²]; None for a known robot's
            own, or 10 on every joint.
        torque_rate: limits of the change of torque, but for gravity's, (nv,) or one for all joints
            [N·m/s or N/s]; infinity for none; None for a known robot's own, or none.
        jerk: limits as those (nv,) [rad/s³ or m/s³].
        armature: inertia of the joints' rotors, times their gears' ratios squared, (nv,) or one for
            all joints [kg·m² or kg]; None for a known robot's own, or none.
        frames: frames of one's own beside a known robot's, by name: each at the `Pose` that it has
            in the frame of a link.

    Raises:
        UnknownNameError: no such robot, link, or joint to move, lock or cut at.
        InvalidValueError: a locked position or base placement that is not finite, a locked joint
            that shall be in the arm, shapes, links to collide as drawn or an inertia of another
            name, a density that is not positive or not read, limits that are not positive or of
            another length, or a negative armature.
        FileContentError: a file that cannot be read, or an MJCF that cannot be used.
        RobotDescriptionError: a URDF or SRDF that cannot be used.
        DensarmError: an MJCF, and MuJoCo is not installed.
    """
    description = robot_description(robot)
    folders = [str(Path(folder).resolve()) for folder in _listed(package_dirs)]
    changes: dict[str, Any] = {"package_dirs": [*folders, *description.package_dirs]}
    if srdf is not None:
        changes["srdf"] = read_text(Path(srdf))
    if base_placement is not None:
        if not isinstance(base_placement, pin.SE3):
            raise InvalidValueError("base_placement", base_placement, "a pinocchio.SE3")
        changes["base_placement"] = pin.SE3ToXYZQUAT(base_placement).tolist()
    chosen = {
        "shapes": shapes,
        "collision_from_visual": collision_from_visual,
        "inertia": inertia,
        "density": density,
    }
    changes |= {key: value for key, value in chosen.items() if value is not None}
    description = replace(description, **changes)
    if cut := _listed(cut_joints):
        description = without_subtrees(description, cut)
    if joints is not None:
        description = only_joints(description, _listed(joints), locked_joints or {})
    else:
        description = without_joints(description, locked_joints or {})
    of_joints = {
        "acceleration": acceleration,
        "torque_rate": torque_rate,
        "jerk": jerk,
        "armature": armature,
    }
    changes = {key: value for key, value in of_joints.items() if value is not None}
    changes["frames"] = {**description.frames, **(frames or {})}
    return Arm(replace(description, **changes))


def _listed(given: Any) -> list[Any]:
    """Return what is given as a list, also where it is one string or path."""
    return [given] if isinstance(given, str | Path) else list(given)
