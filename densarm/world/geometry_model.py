"""The geometry model of a world: the shapes of arm and obstacles, and the pairs that can meet."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import geometry_objects, numbered
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene

_MANY = 100  # shapes, up to which the matrix takes less than the file
_COUNT = "<ngeoms>{}</ngeoms>"


def geometry_model(arm: Arm, scene: Scene) -> tuple[pin.GeometryModel, list[int]]:
    """Return all shapes and pairs, the arm's first, and how many shapes each obstacle has.

    A cloud has a ball for each shape of the arm that moves, and is paired with it by that alone.

    Raises:
        InvalidValueError: as of a `World`.
    """
    for attachment in scene.attachments:
        if attachment not in arm.description.attachments:
            name, allowed = attachment.body.name, "held by the arm: arm.holding(*scene.attachments)"
            raise InvalidValueError("attached body", name, allowed)
    own = list(arm.collision_model.geometryObjects)
    moving = [
        k for k, item in enumerate(own) if item.parentJoint > 0 and item.name not in arm.self_pieces
    ]
    names, held = [item.name for item in own], arm.description.attachments
    touching = {
        (name, obstacle)
        for each in held
        for name in numbered(each.body.name, len(each.body.convex_shapes()))
        for obstacle in each.touch_obstacles
    }
    shapes, taken, counts = own.copy(), set(names), list[int]()
    pairs = [(pair.first, pair.second) for pair in arm.collision_model.collisionPairs]
    for obstacle in scene:
        before = len(shapes)
        facing = [k for k in moving if (names[k], obstacle.name) not in touching]
        for item in geometry_objects(obstacle, origin=arm.origin):
            if item.name in taken:
                allowed = f"other than the names of the shapes of {arm.name!r}"
                raise InvalidValueError("obstacle name", item.name, allowed)
            alone = isinstance(obstacle, PointCloud) and len(facing) > 0
            for links in [[k] for k in facing] if alone else [facing]:
                pairs += [(k, len(shapes)) for k in links]
                shapes.append(item)
        taken |= {item.name for item in shapes[before:]}
        counts.append(len(shapes) - before)
    return _of_shapes(shapes, pairs), counts


def _of_shapes(shapes: list[pin.GeometryObject], pairs: list[tuple[int, int]]) -> pin.GeometryModel:
    """Return a model of shapes and pairs, in a time that grows as they do.

    `addGeometryObject` copies a matrix of all shapes by all shapes each time, minutes for 5,000,
    and `addCollisionPair` compares a pair with all others.
    """
    model = _counting(len(shapes)) if len(shapes) > _MANY else pin.GeometryModel()
    add = model.addGeometryObject if model.ngeoms == 0 else model.geometryObjects.append
    for shape in shapes:
        add(shape)
    for first, second in pairs:
        model.collisionPairs.append(pin.CollisionPair(first, second))
    return model


def _counting(count: int) -> pin.GeometryModel:
    """Return an empty model that counts shapes already, as one can be read from a file.

    It takes them by its vector. Should the format of files change it counts none.
    """
    model, name = pin.GeometryModel(), "model"
    with TemporaryDirectory() as folder:
        file = Path(folder) / "empty.xml"
        model.saveToXML(str(file), name)
        file.write_text(file.read_text().replace(_COUNT.format(0), _COUNT.format(count)))
        model.loadFromXML(str(file), name)
    return model
