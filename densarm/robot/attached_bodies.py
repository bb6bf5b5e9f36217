"""Attached bodies in Pinocchio's models: shapes, pairs and inertia of what an arm holds."""

from collections.abc import Iterable

import coal
import numpy as np
import pinocchio as pin

from densarm.attachment import Attachment
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.obstacles import geometry_objects

_COLOR = np.array([0.36, 0.42, 0.58, 1.0])  # drawn apart from links, as a rule white or grey


def add_attached_shapes(
    model: pin.Model, geometry: pin.GeometryModel, attachments: Iterable[Attachment]
) -> None:
    """Add the shapes of attached bodies to a geometry model, without pairs.

    Args:
        model: the arm.
        geometry: its collision or visual geometry; the shapes are added to it.
        attachments: the bodies.

    Raises:
        UnknownNameError: a link that the URDF does not have.
        InvalidValueError: a body is named like a shape of the arm.
    """
    for attachment in attachments:
        for item in _shapes(model, attachment):
            if geometry.existGeometryName(item.name):
                allowed = "other than the names of the arm's shapes and attached bodies"
                raise InvalidValueError("name of attached body", item.name, allowed)
            item.meshColor = _COLOR
            geometry.addGeometryObject(item)


def add_attached_pairs(
    model: pin.Model, geometry: pin.GeometryModel, attachments: Iterable[Attachment]
) -> None:
    """Add the self-collision pairs of attached bodies to a collision model.

    Each shape is paired with every other one that a joint moves against it, but for those on
    links that the body may touch.

    Args:
        model: the arm.
        geometry: its collision shapes, the attached ones among them; the pairs are added to it.
        attachments: the bodies.

    Raises:
        UnknownNameError: a link that the URDF does not have.
    """
    links = [model.frames[item.parentFrame].name for item in geometry.geometryObjects]
    joints = [item.parentJoint for item in geometry.geometryObjects]
    for attachment in attachments:
        for link in attachment.touch_links:
            _frame(model, link, attachment)
        for item in _shapes(model, attachment):
            index = geometry.getGeometryId(item.name)
            for other in range(geometry.ngeoms):
                if joints[other] != item.parentJoint and links[other] not in attachment.touch_links:
                    # Pinocchio refuses the pair that two attached bodies both ask for.
                    pair = pin.CollisionPair(min(index, other), max(index, other))
                    if not geometry.existCollisionPair(pair):
                        geometry.addCollisionPair(pair)


def add_attached_inertia(model: pin.Model, attachments: Iterable[Attachment]) -> None:
    """Add the inertia of attached bodies to the links that hold them.

    Args:
        model: the arm; changed.
        attachments: the bodies; those without mass add nothing.

    Raises:
        UnknownNameError: a link that the URDF does not have.
    """
    for attachment in attachments:
        items = _shapes(model, attachment) if attachment.mass > 0.0 else []
        volume = sum(item.geometry.computeVolume() for item in items)
        for item in items:
            inertia = _inertia(item.geometry, attachment.mass / volume)
            model.appendBodyToJoint(item.parentJoint, inertia, item.placement)


def _shapes(model: pin.Model, attachment: Attachment) -> list[pin.GeometryObject]:
    index = _frame(model, attachment.link, attachment)
    frame = model.frames[index]
    return geometry_objects(attachment.body, frame.parentJoint, index, frame.placement)


def _frame(model: pin.Model, link: str, attachment: Attachment) -> int:
    names = [frame.name for frame in model.frames]
    if link not in names:
        raise UnknownNameError(f"link for {attachment.body.name!r}", link, names)
    return names.index(link)


def _inertia(shape: coal.CollisionGeometry, density: float) -> pin.Inertia:
    turning = density * np.array(shape.computeMomentofInertiaRelatedToCOM())
    symmetric = 0.5 * (turning + turning.T)
    return pin.Inertia(density * shape.computeVolume(), np.array(shape.computeCOM()), symmetric)
