"""Links in convex pieces: everywhere, or in pairs whose hulls overlap where the meshes do not."""

from collections.abc import Iterable
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from densarm.arms.convex_pieces import (
    LEAST_GAIN,
    MOST_PIECES,
    ConvexTree,
    convex_tree,
    winding_number,
)
from densarm.arms.self_collision import ExcludedPair, Exclusion, random_configurations
from densarm.scene.mesh import indexed_triangles
from densarm.scene.shapes import convex_hull, extreme_points
from densarm.values.arrays import Array
from densarm.values.files import kept_arrays

LARGE = 1.15
"""A hull of more than so many times its mesh's volume is much larger than the mesh."""

_SAMPLES = 5000  # random configurations in which hulls are compared with meshes
_APART = 0.004  # [m], by which meshes must be apart there for the hulls to matter
_CLEAR = 0.002  # [m], by which pieces shall be apart there
_COMPARED = 500  # of those configurations, for each pair, in which pieces are tried
_LOOKED_AT = 60_000_000  # triangles of meshes that are compared there, which bounds the time
_CUT = 125_000  # triangles of links that are cut for some pairs alone
_DOING = "cutting links into convex pieces, once on this machine"
_KEPT = (5, MOST_PIECES, LEAST_GAIN, LARGE, _SAMPLES, _APART, _CLEAR, _COMPARED, _LOOKED_AT, _CUT)

_Pair = tuple[int, int]
_Known = list[tuple[_Pair, list[Array]]]
"""Pairs, and configurations where their hulls overlap and their meshes do not."""
_Front = list[_Pair]
"""Parts of two links, by their indices, that together stand for each pair of their pieces."""


class CutGeometry(NamedTuple):
    """Collision geometry with pieces in it."""

    geometry: pin.GeometryModel
    excluded: tuple[ExcludedPair, ...]
    """The pairs of whole shapes that are left out."""
    self_pieces: frozenset[str]
    """Names of pieces that stand for their link in self-collision pairs alone, beside its hull."""


def cut_into_pieces(
    model: pin.Model,
    hulls: pin.GeometryModel,
    drawn: pin.GeometryModel,
    excluded: tuple[ExcludedPair, ...],
    *,
    everywhere: bool,
) -> CutGeometry:
    """Let pieces stand for hulls that are much larger than their meshes.

    Pairs that are left out since their hulls always collide are checked if their pieces do not.

    Args:
        model: the arm.
        hulls: its convex shapes and self-collision pairs.
        drawn: its collision geometry, with the meshes that the hulls enclose.
        excluded: pairs that are left out.
        everywhere: put the pieces in the place of the hulls. If not, add them for those
            self-collision pairs alone where in some random configuration the hulls overlap, and
            neither the meshes nor the pieces do.
    """
    links = _Links(model, hulls, drawn)
    if not any(links.is_large):
        return CutGeometry(hulls, excluded, frozenset())
    checked = [(pair.first, pair.second) for pair in hulls.collisionPairs]
    always = [links.index(pair) for pair in excluded if pair.reason == Exclusion.ALWAYS]
    fronts = links.fronts(always if everywhere else checked + always)
    rest = tuple(pair for pair in excluded if links.index(pair) not in fronts)
    if everywhere:
        pieces = [links.tree(k).pieces for k in range(hulls.ngeoms)]
        fronts = {(i, j): list(product(pieces[i], pieces[j])) for i, j in [*checked, *fronts]}
    geometry, names = links.cut(fronts, everywhere)
    return CutGeometry(geometry, rest, frozenset() if everywhere else names)


class _Links:
    """Hulls beside the meshes that they enclose."""

    def __init__(
        self, model: pin.Model, hulls: pin.GeometryModel, drawn: pin.GeometryModel
    ) -> None:
        self._model, self._geometry = model, hulls
        self._hulls = list(hulls.geometryObjects)
        self._drawn = [
            drawn.geometryObjects[drawn.getGeometryId(item.name)] for item in self._hulls
        ]
        self.is_large = [
            self._triangles(k) > 0
            and hull.geometry.computeVolume() > LARGE * abs(item.geometry.computeVolume())
            for k, (hull, item) in enumerate(zip(self._hulls, self._drawn, strict=True))
        ]

    def index(self, pair: ExcludedPair) -> _Pair:
        """Return the indices of the two shapes of a pair."""
        first, second = map(self._geometry.getGeometryId, pair.shapes)
        return first, second

    def tree(self, link: int) -> ConvexTree:
        """Return the parts of a link's mesh; its hull alone where that is not much larger."""
        if not self.is_large[link]:
            return ConvexTree([np.empty((0, 3))], np.zeros((1, 2), dtype=np.int64))

        def cut() -> dict[str, Array]:
            vertices, corners = indexed_triangles(self._drawn[link].geometry)
            parts, halves = convex_tree(vertices[corners])
            return {"halves": halves.astype(float), **{f"{k}": x for k, x in enumerate(parts)}}

        kept = kept_arrays(f"tree {_KEPT[:3]}{self._key(link)}", cut, _DOING)
        halves = kept["halves"].astype(np.int64)
        return ConvexTree([kept[f"{k}"] for k in range(len(halves))], halves)

    def cut(
        self, fronts: dict[_Pair, _Front], everywhere: bool
    ) -> tuple[pin.GeometryModel, frozenset[str]]:
        """Return the geometry with parts, beside the hulls or in their place, and their names."""
        used: list[set[int]] = [set() if everywhere else {0} for _ in self._hulls]
        for (i, j), front in fronts.items():
            used[i].update(part for part, _ in front)
            used[j].update(part for _, part in front)
        result, names, shapes = pin.GeometryModel(), set(), {}
        for link, parts in enumerate(used):
            parts.update(self.tree(link).pieces if everywhere else [])
            if 0 in parts:
                shapes[link, 0] = result.addGeometryObject(self._hulls[link])
        for link, parts in enumerate(used):
            for part in sorted(parts - {0}):
                item = self._hulls[link].copy()
                item.name = f"{item.name}.{part}"
                item.geometry = convex_hull(self.tree(link).corners[part])
                shapes[link, part] = result.addGeometryObject(item)
                names.add(item.name)
        checked = [(pair.first, pair.second) for pair in self._geometry.collisionPairs]
        for i, j in dict.fromkeys([*checked, *fronts]):
            for a, b in fronts.get((i, j), [(0, 0)]):
                first, second = sorted([shapes[i, a], shapes[j, b]])
                result.addCollisionPair(pin.CollisionPair(first, second))
        return result, frozenset(names)

    def fronts(self, pairs: list[_Pair]) -> dict[_Pair, _Front]:
        """Return the parts by which pairs are apart in configurations where hulls overlap."""
        concerned = [(i, j) for i, j in pairs if self.is_large[i] or self.is_large[j]]
        if not concerned:
            return {}

        def decide() -> dict[str, Array]:
            found = self._affordable(self._hulls_alone(concerned))
            rows = [(*pair, *parts) for pair, known in found for parts in self._front(pair, known)]
            return {"fronts": np.array(rows, dtype=np.float64).reshape(-1, 4)}

        shapes = [self._key(k) for k in range(len(self._hulls))]
        key = f"fronts {_KEPT}{self._motion()}{shapes}{concerned}"
        result: dict[_Pair, _Front] = {}
        for i, j, a, b in kept_arrays(key, decide, _DOING)["fronts"].astype(int).tolist():
            result.setdefault((i, j), []).append((a, b))
        return {pair: front for pair, front in result.items() if front != [(0, 0)]}

    def _hulls_alone(self, pairs: list[_Pair]) -> _Known:
        """Return pairs and configurations where their hulls overlap and their meshes do not."""
        models = [_geometry_model(items, pairs) for items in (self._hulls, self._drawn)]
        hulls, meshes = ((model, model.createData()) for model in models)
        for request in meshes[1].collisionRequests:
            request.security_margin = _APART
        model, data = self._model, self._model.createData()
        found: list[list[Array]] = [[] for _ in pairs]
        surfaces: dict[int, Array] = {}
        looked_at = 0
        for q in random_configurations(model, _SAMPLES):
            if looked_at > _LOOKED_AT:
                break
            if not pin.computeCollisions(model, data, *hulls, q, False):
                continue
            pin.updateGeometryPlacements(model, data, *meshes)
            for k, result in enumerate(hulls[1].collisionResults):
                if result.isCollision() and len(found[k]) < _COMPARED:
                    looked_at += sum(map(self._triangles, pairs[k]))
                    touching = pin.computeCollision(*meshes, k)
                    if not touching and not one_inside_the_other(*meshes, k, surfaces):
                        found[k].append(q)
        return [(pair, known) for pair, known in zip(pairs, found, strict=True) if known]

    def _affordable(self, found: _Known) -> _Known:
        """Return the pairs whose links may be cut, those that need it most often first."""
        chosen, cut, left = [], set[int](), _CUT
        for pair, known in sorted(found, key=lambda item: -len(item[1])):
            needed = {link for link in pair if self.is_large[link]} - cut
            cost = sum(map(self._triangles, needed))
            if cost <= left:
                chosen.append((pair, known))
                cut, left = cut | needed, left - cost
        return chosen

    def _front(self, pair: _Pair, configurations: list[Array]) -> _Front:
        """Return parts that are apart in as many of some configurations as those of any cut."""
        trees, sides = [self.tree(link) for link in pair], range(2)
        shapes = [
            [self._hulls[link].geometry, *map(convex_hull, tree.corners[1:])]
            for link, tree in zip(pair, trees, strict=True)
        ]
        data, geometry_data = self._model.createData(), self._geometry.createData()
        poses = []
        for q in configurations:
            pin.updateGeometryPlacements(self._model, data, self._geometry, geometry_data, q)
            placed = [geometry_data.oMg[link] for link in pair]
            poses.append([coal.Transform3s(x.rotation, x.translation) for x in placed])
        request = coal.CollisionRequest()
        request.security_margin = _CLEAR

        def overlapping(parts: _Pair, among: Iterable[int]) -> set[int]:
            one, other = (shapes[side][parts[side]] for side in sides)
            return {
                k
                for k in among
                if coal.collide(
                    one, poses[k][0], other, poses[k][1], request, coal.CollisionResult()
                )
            }

        def refined(parts: _Pair, among: Iterable[int]) -> tuple[_Front, set[int]]:
            left = overlapping(parts, among)
            cuts = []
            for side in sides:
                if left and trees[side].halves[parts[side], 0] > 0:
                    halves = trees[side].halves[parts[side]].tolist()
                    cut = [(k, parts[1]) if side == 0 else (parts[0], k) for k in halves]
                    cuts.append((sum(len(overlapping(x, left)) for x in cut), cut))
            if not cuts:
                return [parts], left
            (first, still), (second, too) = (refined(x, left) for x in min(cuts)[1])
            return ([parts], left) if still | too == left else (first + second, still | too)

        def whole(one: list[int], other: list[int]) -> tuple[_Front, set[int]]:
            front = list(product(one, other))
            return front, set().union(*(overlapping(x, range(len(poses))) for x in front))

        pieces = [tree.pieces for tree in trees]
        found = [whole(pieces[0], [0]), whole([0], pieces[1]), refined((0, 0), range(len(poses)))]
        return min(found, key=lambda cut: (len(cut[1]), len(cut[0])))[0]

    def _triangles(self, link: int) -> int:
        """Return the number of a link's triangles, 0 if it is no mesh."""
        shape = self._drawn[link].geometry
        return int(shape.num_tris) if isinstance(shape, coal.BVHModelBase) else 0

    def _motion(self) -> str:
        """Return what tells how the shapes move against each other, wherever the base is."""
        joints, placements = list(self._model.joints)[1:], self._model.jointPlacements
        base = placements[1].inverse()
        placed = [
            (k, base * pose if k == 0 else pose)
            for k, pose in [(self._model.parents[j.id], placements[j.id]) for j in joints]
            + [(hull.parentJoint, hull.placement) for hull in self._hulls]
        ]
        # Rounded, since where the base is changes the last digits; 0.0 takes the sign off a zero.
        poses = [(k, (np.round(pose.homogeneous, 9) + 0.0).tolist()) for k, pose in placed]
        axes = [(joint.nq, joint.createData().S.tolist()) for joint in joints]
        limits = self._model.lowerPositionLimit, self._model.upperPositionLimit
        return f"{poses}{axes}{[x.tolist() for x in limits]}"

    def _key(self, link: int) -> str:
        """Return what tells a shape from others: of a mesh, its file and its scaled vertices."""
        item = self._drawn[link]
        if not isinstance(item.geometry, coal.BVHModelBase):
            return f"{extreme_points(self._hulls[link].geometry)}"
        vertices = np.array(item.geometry.vertices()).tobytes()
        return sha256(Path(item.meshPath).read_bytes() + vertices).hexdigest()


def one_inside_the_other(
    model: pin.GeometryModel, data: pin.GeometryData, k: int, surfaces: dict[int, Array]
) -> bool:
    """Return whether one of two bodies whose surfaces do not meet lies inside the other.

    Args:
        model: meshes and other shapes, and pairs of them.
        data: their placements.
        k: index of the pair.
        surfaces: where triangles of meshes (N, 3, 3) [m] are kept from call to call, by index.
    """
    pair = model.collisionPairs[k]
    for one, other in ((pair.first, pair.second), (pair.second, pair.first)):
        inner, outer = (model.geometryObjects[i].geometry for i in (one, other))
        if not isinstance(outer, coal.BVHModelBase):
            continue
        points = inner.vertices() if isinstance(inner, coal.BVHModelBase) else np.zeros((1, 3))
        pose, around = data.oMg[other].actInv(data.oMg[one]), np.array(outer.vertices())
        points = points @ pose.rotation.T + pose.translation
        if (points > around.min(axis=0)).all() and (points < around.max(axis=0)).all():
            if other not in surfaces:
                vertices, triangles = indexed_triangles(outer)
                surfaces[other] = vertices[triangles]
            if abs(winding_number(surfaces[other], points[0])) > 0.5:
                return True
    return False


def _geometry_model(items: list[pin.GeometryObject], pairs: list[_Pair]) -> pin.GeometryModel:
    model = pin.GeometryModel()
    for item in items:
        model.addGeometryObject(item)
    for first, second in pairs:
        model.addCollisionPair(pin.CollisionPair(first, second))
    return model
