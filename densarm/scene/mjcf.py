"""MJCF, the models of MuJoCo, as its own compiler reads them; and what is an obstacle there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from densarm.errors import DensarmError, FileContentError
from densarm.scene.mesh import Mesh, hull_corners
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere, pose_fields
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.files import read_text

if TYPE_CHECKING:
    import mujoco

_ROOT = re.compile(r"(?:\s|<\?.*?\?>|<!--.*?-->|<!\w[^>]*>)*<([\w:.-]+)", re.DOTALL)

_MEND = "use boxes, spheres, capsules, cylinders or meshes, or let it collide with nothing by "
_MEND += 'contype="0" conaffinity="0"'


def require_mujoco(what: str) -> Any:
    """Return the module, or refuse with how to install it.

    Args:
        what: needs it, as an error begins.

    Raises:
        DensarmError: MuJoCo is not installed.
    """
    try:
        import mujoco
    except ImportError:
        message = f"{what} needs MuJoCo, which is not installed: pip install 'densarm[mujoco]'"
        raise DensarmError(message) from None
    return mujoco


def xml_root(text: str) -> str:
    """Return the name of the element that an XML text begins with; empty for none."""
    found = _ROOT.match(text)
    return found[1] if found else ""


def mjcf_spec(path: Path) -> mujoco.MjSpec:
    """Return an MJCF file as MuJoCo has it before it compiles it.

    Raises:
        FileContentError: it cannot be read, in MuJoCo's words.
        DensarmError: MuJoCo is not installed.
    """
    read_text(path)
    try:
        return require_mujoco(str(path)).MjSpec.from_file(str(path.resolve()))
    except ValueError as error:
        raise FileContentError(path, " ".join(str(error).split())) from None


def compiled_mjcf(path: Path) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """Return an MJCF file as it is, and its model, where defaults and units are resolved.

    Raises:
        FileContentError: as `mjcf_spec`, or it cannot be compiled.
    """
    spec = mjcf_spec(path)
    try:
        return spec, spec.compile()
    except ValueError as error:
        raise FileContentError(path, " ".join(str(error).split())) from None


def jointed_bodies(model: mujoco.MjModel) -> list[int]:
    """Return the bodies of all trees in which a joint moves one against another, parents first.

    These are arms, with what they stand on. What else there is, free bodies too, is their scene.
    """
    import mujoco

    free = mujoco.mjtJoint.mjJNT_FREE
    trees = {int(model.body_rootid[b]) for b in model.jnt_bodyid[model.jnt_type != free]}
    return [b for b in range(1, model.nbody) if int(model.body_rootid[b]) in trees]


def collides(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom is more than drawn: by its bits, or as one of a <pair>."""
    by_bits = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
    return by_bits or geom in model.pair_geom1 or geom in model.pair_geom2


def geom_label(model: mujoco.MjModel, geom: int) -> str:
    """Return what errors call a geom: its name, or which one of its body it is."""
    if name := str(model.geom(geom).name):
        return f"geom {name!r}"
    body = int(model.geom_bodyid[geom])
    return f"geom {geom - int(model.body_geomadr[body])} of body {model.body(body).name!r}"


def unsupported_geom(path: Path, model: mujoco.MjModel, geom: int) -> FileContentError:
    """Return the error about a geom of a kind that has no place."""
    import mujoco

    word = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    return FileContentError(path, f"{geom_label(model, geom)} is of the type {word}: {_MEND}")


def read_mjcf_scene(path: Path) -> Scene:
    """Return as obstacles what collides in an MJCF file and is no part of `jointed_bodies`.

    It is where the file has it, free bodies at rest. A plane becomes the half-space below it, as
    for MuJoCo's contacts, a mesh its convex hull, likewise. An obstacle has the name of its geom,
    else of its body, with a number where that has several.

    Raises:
        FileContentError: as `compiled_mjcf`, or a geom that has no place, by its name.
    """
    _, model = compiled_mjcf(path)
    import mujoco

    data, arm = mujoco.MjData(model), set(jointed_bodies(model))
    mujoco.mj_kinematics(model, data)
    found, names = list[Obstacle](), _names(model)
    for geom, name in zip(range(model.ngeom), names, strict=True):
        if int(model.geom_bodyid[geom]) in arm or not collides(model, geom):
            continue
        pose = pin.SE3(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])
        try:
            obstacle = _obstacle(mujoco.mjtGeom, model, geom, name, pose_fields(pose))
        except DensarmError as error:
            raise FileContentError(path, f"{geom_label(model, geom)}: {error}") from None
        if obstacle is None:
            raise unsupported_geom(path, model, geom)
        found.append(obstacle)
    return Scene(found)


def mesh_vertices(model: mujoco.MjModel, geom: int) -> Array:
    """Return the vertices of a geom's mesh (N, 3) [m], in the frame of the geom."""
    mesh = int(model.geom_dataid[geom])
    begin = int(model.mesh_vertadr[mesh])
    return np.array(model.mesh_vert[begin : begin + model.mesh_vertnum[mesh]], dtype=np.float64)


def _obstacle(
    kinds: Any, model: mujoco.MjModel, geom: int, name: str, placed: dict[str, Any]
) -> Obstacle | None:
    kind, size = kinds(int(model.geom_type[geom])), model.geom_size[geom].tolist()
    if kind == kinds.mjGEOM_PLANE:
        return HalfSpace(name=name, **placed)
    if kind == kinds.mjGEOM_SPHERE:
        return Sphere(name=name, radius=size[0], **placed)
    if kind == kinds.mjGEOM_CAPSULE:
        return Capsule(name=name, radius=size[0], length=2.0 * size[1], **placed)
    if kind == kinds.mjGEOM_CYLINDER:
        return Cylinder(name=name, radius=size[0], length=2.0 * size[1], **placed)
    if kind == kinds.mjGEOM_BOX:
        return Box(name=name, size=[2.0 * side for side in size], **placed)
    if kind == kinds.mjGEOM_MESH:
        return Mesh(name=name, pieces=[hull_corners(mesh_vertices(model, geom))], **placed)
    return None


def _names(model: mujoco.MjModel) -> Iterator[str]:
    """Yield a name for each geom, no two alike."""
    taken = {str(model.geom(geom).name) for geom in range(model.ngeom)}
    for geom in range(model.ngeom):
        name, body = str(model.geom(geom).name), int(model.geom_bodyid[geom])
        if not name:
            own = str(model.body(body).name) or f"body_{body}"
            first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
            name = own if count == 1 else f"{own}.{geom - first}"
            while name in taken:
                name += "_"
            taken.add(name)
        yield name
