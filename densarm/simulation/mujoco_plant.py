"""MujocoPlant: the arm, or a model of one's own, in MuJoCo, which finds contacts by itself."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin

from densarm.arms.joint_space import joint_axis
from densarm.certificates.task import Input
from densarm.errors import DensarmError, InvalidValueError
from densarm.scene.mjcf import mjcf_spec, require_mujoco
from densarm.simulation.disturbances import Disturbances
from densarm.values.arrays import Array
from densarm.values.checks import positive
from densarm.world.world import World

if TYPE_CHECKING:
    import mujoco

_SUBSTEP = 5e-4  # [s] at most
_LEAST = 1e-12  # [kg, kg·m²] of a body, as MuJoCo takes none without
_ALL_KINDS = 0x7FFFFFFF  # a geom that collides with all that collide
_HELD = 1e6  # [kg·m² or kg], of a rotor that holds a joint which is not the arm's
_FAR = 1e5  # [m], below their own z, where spare obstacles are
_SHAPE = "shape "  # before the index of a shape of the world, in the name of its geom
_AWAY = 1e-3  # [m, rad] by which an axis may be elsewhere in a model of one's own


class MujocoPlant:
    r"""A `Plant` in MuJoCo, whose input is torque.

    The model is made of the arm's: the same inertias, shapes, pairs that may touch, and obstacles;
    it differs by its disturbances. Steps are implicit in velocity, 0.5 ms at most. Dry friction is
    MuJoCo's own, which creeps by some mrad/s where it should stick. Joints have no end stops.

    Args:
        world: the arm among obstacles; those that move are followed.
        dt: time step [s].
        disturbances: how the arm differs from its model; `simulate` adds those of signals.
        spec: a model of one's own in place of the arm's, as by `from_mjcf`, and not kept unchanged.
        joints: names of its joints, in the arm's order; None for those of the arm.

    Raises:
        DensarmError: MuJoCo is not installed, or cannot make the model, or it lacks joints.
        InvalidValueError: joints elsewhere than the arm's, or disturbances that it cannot have.
        RobotDescriptionError: the arm has links without a mass.

    Source: https://mujoco.readthedocs.io/en/stable/computation
    """

    input = Input.TORQUE
    name = "mujoco"

    def __init__(
        self,
        world: World,
        dt: float = 0.001,
        disturbances: Disturbances = Disturbances(),
        *,
        spec: mujoco.MjSpec | None = None,
        joints: Sequence[str] | None = None,
    ) -> None:
        self._mujoco = mj = require_mujoco("plant 'mujoco'")
        self.dt, self.disturbances = positive("dt", dt), disturbances
        self._world, arm = world, world.arm
        self._own = spec is not None
        if spec is None:
            arm.require_masses("a plant driven by torque")
            model, names = disturbances.model(arm), arm.joint_names
            spec, self._origin = _arm_spec(mj, model), np.zeros(3)
            for k in range(_first_obstacle(world)):
                _add_shape(mj, spec, world, k, spec.body(_link(world, k)))
            for first, second in world.pair_shapes:
                spec.add_pair(geomname1=f"{_SHAPE}{first}", geomname2=f"{_SHAPE}{second}")
        else:
            names, self._origin = tuple(joints or arm.joint_names), arm.origin
            _require_joints(spec, names, arm.joint_names)
        for k in range(_first_obstacle(world), world.geometry_model.ngeoms):
            pose = _seen(world.geometry_model.geometryObjects[k].placement, self._origin)
            body = spec.worldbody.add_body(name=f"{_SHAPE}{k}", **_placed(pose))
            _add_shape(mj, spec, world, k, body, _ALL_KINDS if self._own else 0)
        self._substeps = max(1, int(np.ceil(dt / _SUBSTEP - 1e-9)))
        spec.option.timestep = dt / self._substeps
        spec.option.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
        try:
            self.model: mujoco.MjModel = spec.compile()
        except ValueError as error:
            raise DensarmError(f"MuJoCo: {' '.join(str(error).split())}") from None
        self.data: mujoco.MjData = mj.MjData(self.model)
        at = [self.model.joint(name) for name in names]
        self._qpos = np.array([int(joint.qposadr[0]) for joint in at])
        self._dofs = np.array([int(joint.dofadr[0]) for joint in at])
        self._disturb(disturbances, None if self._own else model)
        moved = np.zeros(self.model.nbody, bool)
        for body in range(1, self.model.nbody):  # parents come first
            has_joint = np.isin(self.model.body_dofadr[body] + np.arange(6), self._dofs)
            moved[body] = moved[self.model.body_parentid[body]] or (
                has_joint[: self.model.body_dofnum[body]].any()
            )
        self._is_arm = moved[self.model.geom_bodyid]
        self._last, self._contact = (np.full(arm.nq, np.nan), np.zeros(arm.nv)), ""
        self._viewer: Any = None
        self._shown = 0.0  # when [s]
        self._place_obstacles()
        if self._own:
            self._require_same_axes(names)

    def __repr__(self) -> str:
        return f"MujocoPlant({self._world}, dt={self.dt:g})"

    @classmethod
    def from_mjcf(
        cls,
        world: World,
        path: str | Path,
        dt: float = 0.001,
        disturbances: Disturbances = Disturbances(),
        joints: Sequence[str] | None = None,
    ) -> MujocoPlant:
        """Return a plant of one's own MJCF, with the world's obstacles around it.

        Its masses, friction and shapes count, and contacts of what the arm's joints move are its
        own. Its actuators and joint limits do not, and its other joints are held where they are.

        Args:
            world: the arm, whose model the controller has, among obstacles.
            path: of the MJCF, the arm where the world's is and zero where its joints are at zero.
            dt: time step [s].
            disturbances: beside what the MJCF says; a payload is to be written into it.
            joints: names of its joints, in the arm's order; None for those of the arm.

        Raises:
            FileContentError: it cannot be read.
            DensarmError: as `MujocoPlant`.
        """
        return cls(world, dt, disturbances, spec=mjcf_spec(Path(path)), joints=joints)

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Act as `Plant.step`, u the torque [N·m or N].

        The state is MuJoCo's, solver and all, unless q is not what the last step returned.
        """
        mj, model, data = self._mujoco, self.model, self.data
        is_new = not (np.array_equal(q, self._last[0]) and np.array_equal(v, self._last[1]))
        if not np.array_equal(q, self._last[0]):
            mj.mj_resetData(model, data)
            self._hold_others()
            data.qpos[self._qpos] = self._world.arm.angles(q)
        if self._placed != self._world.version:
            self._place_obstacles()
            is_new = True
        told = mj.get_mju_user_warning()
        # Of what diverges MuJoCo would write into a file where the process is.
        mj.set_mju_user_warning(lambda _: None)
        if is_new:
            data.qvel[self._dofs] = v
            mj.mj_step1(model, data)
        data.qfrc_applied[self._dofs] = u
        self._contact = ""
        for _ in range(self._substeps):
            mj.mj_step2(model, data)
            mj.mj_step1(model, data)  # by halves, so that contacts are those of the state returned
            if data.ncon and not self._contact:
                self._contact = self._deepest()
        mj.set_mju_user_warning(told)
        q, v = self._world.arm.configurations(data.qpos[self._qpos]), data.qvel[self._dofs]
        self._last = q.copy(), v.copy()
        if self._viewer is not None and self._viewer.is_running():
            self._viewer.sync()
            time.sleep(max(0.0, self._shown + self.dt - time.perf_counter()))
            self._shown = time.perf_counter()
        return q, v

    def describe_contact(self) -> str:
        """Return what touched in the last step, as a phrase; empty for nothing."""
        return self._contact

    def view(self) -> None:
        """Open MuJoCo's viewer on the plant, which shows each step in real time from then on.

        Raises:
            DensarmError: there is no display.
        """
        import glfw  # which the viewer is drawn by; without a display that ends the process
        import mujoco.viewer

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if not glfw.init():
                raise DensarmError("the viewer needs a display, and finds none")
        self._viewer = mujoco.viewer.launch_passive(self.model, self.data)

    def _deepest(self) -> str:
        """Return the deepest contact of the arm in MuJoCo's words, as a phrase."""
        contact = self.data.contact
        is_arm = self._is_arm[contact.geom].any(axis=1)
        distance = np.where(is_arm, contact.dist, np.inf)
        k = int(distance.argmin())
        if distance[k] > 0.0:
            return ""
        first, second = (self._geom_name(int(geom)) for geom in contact.geom[k])
        return f"{first} and {second}, {-1e3 * distance[k]:.3g} mm deep by MuJoCo"

    def _geom_name(self, geom: int) -> str:
        name = str(self.model.geom(geom).name)
        if name.startswith(_SHAPE):
            return str(self._world.geometry_model.geometryObjects[int(name[len(_SHAPE) :])].name)
        return name or f"a geom of {self.model.body(self.model.geom_bodyid[geom]).name!r}"

    def _disturb(self, disturbances: Disturbances, exact: pin.Model | None) -> None:
        """Write what is not written in the MJCF: friction, rotors, inertias as they are."""
        arm, model = self._world.arm, self.model
        model.dof_damping[self._dofs] += disturbances.joint_values("viscous", arm)
        model.dof_frictionloss[self._dofs] += disturbances.joint_values("coulomb", arm)
        if exact is not None:
            model.dof_armature[:] = exact.armature
            for joint in range(1, exact.njoints):  # MuJoCo rounds inertias that are no body's
                inertia = exact.inertias[joint]
                model.body_mass[joint] = max(inertia.mass, _LEAST)
                model.body_inertia[joint] = np.maximum(_principal(inertia)[0], _LEAST)
        else:
            if disturbances.payload:
                raise InvalidValueError(
                    "disturbances.payload", disturbances.payload, "a body of one's own MJCF"
                )
            scales = disturbances.joint_values("mass_scale", arm)
            bodies = model.dof_bodyid[self._dofs]
            model.dof_armature[self._dofs] += disturbances.joint_values("armature", arm)
            for body in range(1, model.nbody):
                above = body
                while above and above not in bodies:
                    above = int(model.body_parentid[above])
                scale = float(scales[np.argmax(bodies == above)]) if above else 1.0
                model.body_mass[body] *= scale
                model.body_inertia[body] *= scale
            model.opt.gravity[:] = disturbances.tilted(model.opt.gravity)
            others = np.setdiff1d(np.arange(model.nv), self._dofs)
            model.dof_armature[others] += _HELD
        flags = self._mujoco.mjtDisableBit
        model.opt.disableflags |= int(
            flags.mjDSBL_LIMIT | flags.mjDSBL_ACTUATION | flags.mjDSBL_AUTORESET
        )
        self._mujoco.mj_setConst(model, self.data)

    def _require_same_axes(self, names: Sequence[str]) -> None:
        """Refuse a model whose joints are elsewhere than the arm's, or count the other way."""
        arm, angles = self._world.arm, np.linspace(0.3, 0.6, self._world.arm.nv)
        self._hold_others()
        self.data.qpos[self._qpos] = angles
        self._mujoco.mj_kinematics(self.model, self.data)
        pin.forwardKinematics(arm.model, arm.data, arm.configuration(angles))
        for k, name in enumerate(names):
            pose, at = arm.data.oMi[k + 1], self.model.joint(name).id
            along, slides = joint_axis(arm.model, k + 1)
            axis = pose.rotation @ along
            apart = self.data.xanchor[at] - pose.translation - arm.origin
            turned = float(np.arccos(np.clip(self.data.xaxis[at] @ axis, -1.0, 1.0)))
            off = 0.0 if slides else float(np.linalg.norm(apart - (apart @ axis) * axis))
            if max(turned, off) > _AWAY:
                found = f"{1e3 * off:.3g} mm away, turned by {turned:.2g} rad"
                allowed = "about the axis of the arm's joint, zero where it is zero"
                raise InvalidValueError(f"joint {name!r} of the MJCF", found, allowed)
        self._mujoco.mj_resetData(self.model, self.data)

    def _hold_others(self) -> None:
        """Put joints that are not the arm's where the arm has them locked."""
        for name, position in self._world.arm.description.locked_joints.items():
            joint = self._mujoco.mj_name2id(self.model, self._mujoco.mjtObj.mjOBJ_JOINT, name)
            if joint >= 0:
                self.data.qpos[self.model.jnt_qposadr[joint]] = position

    def _place_obstacles(self) -> None:
        """Put obstacles where they are now; those that are spare go out of reach."""
        world, model = self._world, self.model
        away = world.changes < 0
        for cloud in world.clouds:  # whose balls MuJoCo does not move
            away[cloud.pairs] = True
        spare = set(world.pair_shapes[away].max(axis=1))
        for k in range(_first_obstacle(world), world.geometry_model.ngeoms):
            item = world.geometry_model.geometryObjects[k]
            pose = _seen(item.placement, self._origin)
            far = _FAR * pose.rotation[:, 2] if k in spare else 0.0
            body, geom = model.body(f"{_SHAPE}{k}"), model.geom(f"{_SHAPE}{k}").id
            body.pos[:], body.quat[:] = pose.translation - far, _quaternion(pose)
            if isinstance(item.geometry, coal.Sphere | coal.Capsule):
                half = getattr(item.geometry, "halfLength", 0.0)
                model.geom_size[geom, :2] = item.geometry.radius, half
                model.geom_rbound[geom] = item.geometry.radius + half
        self._placed = world.version


def _require_joints(spec: mujoco.MjSpec, names: Sequence[str], of_arm: Sequence[str]) -> None:
    """Refuse a model without the joints that an arm has."""
    found = [joint.name for joint in spec.joints]
    if len(names) != len(of_arm) or not set(names) <= set(found):
        wanted = f"looked for as {', '.join(names)}" if tuple(names) != of_arm else "looked for"
        raise DensarmError(
            f"joints do not match: the arm's, {', '.join(of_arm)}, are {wanted}, and the MJCF has "
            f"{', '.join(found) or 'none'}: rename them, or give the MJCF's names as joints=[...]"
        )


def _arm_spec(mj: Any, model: pin.Model) -> mujoco.MjSpec:
    """Return the links and joints of an arm's model."""
    spec = mj.MjSpec()
    spec.compiler.degree, spec.compiler.balanceinertia = False, True
    spec.option.gravity = model.gravity.linear
    bodies = [spec.worldbody]
    for joint in range(1, model.njoints):
        pose, name = model.jointPlacements[joint], model.names[joint]
        body = bodies[model.parents[joint]].add_body(name=name, **_placed(pose))
        axis, slides = joint_axis(model, joint)
        kind = mj.mjtJoint.mjJNT_SLIDE if slides else mj.mjtJoint.mjJNT_HINGE
        body.add_joint(name=name, type=kind, axis=axis.tolist())
        inertia = model.inertias[joint]
        moments, frame = _principal(inertia)
        body.explicitinertial, body.mass = True, max(inertia.mass, _LEAST)
        body.inertia = np.maximum(moments, _LEAST).tolist()
        body.ipos, body.iquat = inertia.lever.tolist(), _quaternion(frame)
        bodies.append(body)
    return spec


def _add_shape(
    mj: Any, spec: mujoco.MjSpec, world: World, k: int, body: mujoco.MjsBody, kinds: int = 0
) -> None:
    """Add a shape of the world to a link or an obstacle; it collides with its pairs, and kinds."""
    item, name = world.geometry_model.geometryObjects[k], f"{_SHAPE}{k}"
    shape, kind = item.geometry, mj.mjtGeom
    told: dict[str, Any] = _placed(
        item.placement if k < _first_obstacle(world) else pin.SE3.Identity()
    )
    if isinstance(shape, coal.Sphere):
        told |= {"type": kind.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0]}
    elif isinstance(shape, coal.Capsule):
        told |= {"type": kind.mjGEOM_CAPSULE, "size": [shape.radius, shape.halfLength, 0.0]}
    elif isinstance(shape, coal.Halfspace):
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), shape.n)
        told |= _placed(pin.SE3(turn.matrix(), shape.d * shape.n))
        told |= {"type": kind.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0]}
    else:
        mesh = spec.add_mesh(name=name, uservert=np.array(shape.points()).ravel().tolist())
        mesh.inertia = mj.mjtMeshInertia.mjMESH_INERTIA_SHELL  # thin plates have one too
        told |= {"type": kind.mjGEOM_MESH, "meshname": name}
    body.add_geom(name=name, contype=kinds, conaffinity=kinds, **told)


def _first_obstacle(world: World) -> int:
    """Return the index of the first shape that is an obstacle's."""
    return int(world.arm.collision_model.ngeoms)


def _link(world: World, k: int) -> str:
    """Return the name of the body that a shape of the arm moves with."""
    joint = world.geometry_model.geometryObjects[k].parentJoint
    return str(world.arm.model.names[joint]) if joint else "world"


def _principal(inertia: pin.Inertia) -> tuple[Array, pin.SE3]:
    """Return principal moments (3,) [kg·m²] and their frame."""
    moments, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return moments, pin.SE3(axes, inertia.lever)


def _seen(pose: pin.SE3, origin: Array) -> pin.SE3:
    return pin.SE3(pose.rotation, pose.translation + origin)


def _placed(pose: pin.SE3) -> dict[str, Any]:
    return {"pos": pose.translation.tolist(), "quat": _quaternion(pose)}


def _quaternion(pose: pin.SE3) -> list[float]:
    x, y, z, w = pin.Quaternion(pose.rotation).normalized().coeffs().tolist()
    return [w, x, y, z]
