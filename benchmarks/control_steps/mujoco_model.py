"""The task's arm and spheres as a MuJoCo model."""

import coal
import mujoco
import numpy as np
import pinocchio as pin

from control_steps.task import ControlTask

SITE = "end_effector"
_LEAST_INERTIA = 1e-9  # MuJoCo refuses a moving body without inertia; kinematics does not use it


def mujoco_model(task: ControlTask) -> mujoco.MjModel:
    """Return the model: the same joints, limits and shapes; each sphere is a body of its own.

    Spheres are mocap bodies: mink leaves pairs of parent and child out, and the world is the
    parent of the first link.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    bodies = [spec.worldbody]
    model = task.arm.model
    for joint in range(1, model.njoints):
        bodies.append(_add_link(bodies[model.parents[joint]], model, joint))
    for item in task.arm.collision_model.geometryObjects:
        _add_shape(spec, bodies[item.parentJoint], item)
    frame = model.frames[task.arm.end_effector_frame]
    bodies[frame.parentJoint].add_site(name=SITE, **_pose(frame.placement))
    for sphere in task.spheres:
        body = spec.worldbody.add_body(name=sphere.name, pos=list(sphere.position), mocap=True)
        size = [sphere.radius, 0.0, 0.0]
        body.add_geom(name=sphere.name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size)
    return spec.compile()


def _add_link(parent: mujoco.MjsBody, model: pin.Model, joint: int) -> mujoco.MjsBody:
    body = parent.add_body(name=model.names[joint], **_pose(model.jointPlacements[joint]))
    k = model.joints[joint].idx_q
    body.add_joint(
        name=model.names[joint],
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=_axis(model, joint),
        range=[model.lowerPositionLimit[k], model.upperPositionLimit[k]],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
    )
    body.explicitinertial = True
    body.mass, body.inertia = 1.0, 3 * [_LEAST_INERTIA]
    return body


def _axis(model: pin.Model, joint: int) -> list[float]:
    motion = np.ravel(model.joints[joint].createData().S)
    return [float(x) for x in motion[3:]]


def _add_shape(spec: mujoco.MjSpec, body: mujoco.MjsBody, item: pin.GeometryObject) -> None:
    shape, pose = item.geometry, _pose(item.placement)
    if isinstance(shape, coal.Capsule):
        size = [shape.radius, shape.halfLength, 0.0]
        body.add_geom(name=item.name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=size, **pose)
    else:
        points = [x for k in range(shape.num_points) for x in shape.point(k)]
        spec.add_mesh(name=item.name, uservert=points)
        mesh = mujoco.mjtGeom.mjGEOM_MESH
        body.add_geom(name=item.name, type=mesh, meshname=item.name, **pose)


def _pose(placement: pin.SE3) -> dict[str, list[float]]:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs().tolist()
    return {"pos": placement.translation.tolist(), "quat": [w, x, y, z]}
