"""Masses of links: which have none, what their shapes give them, and where the arm needs one."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection

import numpy as np
import pinocchio as pin

from densarm.arms.collision_shapes import filled_links
from densarm.errors import RobotDescriptionError

DEFAULT_DENSITY = 1000.0
"""Of links that get a mass from their shapes, where no other is given: that of water [kg/m³]."""

_NUMBERS = ("value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_SAMPLES = 5
_SINGULAR = 1e-10


def links_without_inertial(urdf: ElementTree.Element) -> set[str]:
    """Return the links of a URDF that have no <inertial>, or one that is all zero."""
    return {
        link.get("name", "")
        for link in urdf.iter("link")
        if all(
            float(part.get(key, "0")) == 0.0
            for part in link.iterfind("inertial/*")
            for key in _NUMBERS
        )
    }


def add_masses(
    model: pin.Model, geometry: pin.GeometryModel, links: Collection[str], density: float
) -> None:
    """Give links the inertia of their shapes, as the URDF has them, of a density [kg/m³].

    Where shapes of a link overlap, both count, but for the balls on the ends of a cylinder.
    """
    for frame, inertia in filled_links(model, geometry, density).items():
        joint = model.frames[frame].parentJoint
        if joint > 0 and model.frames[frame].name in links:
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())


def needed_masses(model: pin.Model) -> tuple[str, ...]:
    """Return the links that joints move without any mass, if the mass matrix is singular for them.

    It may be regular where what such a joint carries has a mass, off its axis.

    Raises:
        RobotDescriptionError: the mass matrix is singular by an inertia that is not positive.
    """
    if not _singular_at(model):
        return ()
    whole, massless = model.copy(), []
    for joint in range(1, model.njoints):
        if not model.inertias[joint].toDynamicParameters().any():
            whole.inertias[joint] = pin.Inertia(1.0, np.zeros(3), np.eye(3))
            massless.append(joint)
    if joint := _singular_at(whole):
        raise RobotDescriptionError(
            f"joint {model.names[joint]!r} moves an inertia that is not positive, so the mass "
            "matrix is singular: mend the <inertial> of its links, or lock it"
        )
    links = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    return tuple(next(f.name for f in links if f.parentJoint == joint) for joint in massless)


def _singular_at(model: pin.Model) -> int:
    """Return the last joint that makes M singular, at rest or at random places; 0 if none does."""
    data = model.createData()
    random = np.random.default_rng(0)
    for k in range(_SAMPLES):
        step = np.minimum(k, 1) * random.uniform(-np.pi, np.pi, model.nv)
        mass = pin.crba(model, data, pin.integrate(model, pin.neutral(model), step))
        pin.cholesky.decompose(model, data)
        # The inertia about a joint while the joints after it are free, and while they are held.
        enough = (_SINGULAR * np.diagonal(mass) < data.D) & np.isfinite(data.D)
        if not enough.all():
            return 1 + int(np.flatnonzero(~enough)[-1])
    return 0
