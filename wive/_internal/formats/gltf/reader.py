"""glTF 2.0: triangles of a .gltf or .glb file, in the order of its nodes.

No reader on PyPI keeps that order and gives the accessors right: trimesh passes over sparse values and the
scale of normalised integers and orders meshes by its own graph; pygltflib and gltflib read the JSON alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats import Mesh
from wive._internal.formats.gltf.accessors import Accessor, describe, values
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.draco import is_compressed, unpack
from wive._internal.formats.gltf.fields import Fields, index_of, members, objects, whole
from wive._internal.formats.gltf.nodes import Drawn, Scene
from wive._internal.formats.gltf.pose import default_weights, joint_matrices, morphed, skinned
from wive._internal.formats.named import named
from wive._internal.formats.placing import IDENTITY, Counts, Matrix, Part, joined
from wive._internal.formats.triangulate import fan, strip
from wive._internal.room import expect_room

MATRIX = 16  # numbers
LISTS, FAN = 4, 6  # modes; 5 is a strip
Shape = tuple[NDArray[Any], NDArray[np.int32]]  # positions and corners of a primitive, in its mesh


@dataclass(frozen=True)
class Primitive:
    """A primitive of triangles, checked, and what tells its size before it is read."""

    place: str
    fields: Fields
    positions: Accessor
    indices: Accessor | None
    mode: int
    triangles: int


def read(data: bytes, name: str, folder: str | None) -> Mesh:
    """Vertices (v,3) and faces (f,3) of the document's scene.

    Nodes come depth first, children in order, and each draws the primitives of its mesh in order, each with
    its vertices and its triangles as the file lists them, placed in the world by float64 matrices. Vertices
    are float32 if the file's are and nothing moves them, else float64. External buffers lie in `folder`.
    """
    with named(name):
        return _read(Document(data, folder))


def _read(document: Document) -> Mesh:
    scene = Scene(document)
    meshes = Meshes(document, scene)
    sizes = [(meshes.size(drawn), drawn.copies) for drawn in scene.drawn]
    # Made one node at a time, then joined.
    expect_room(2 * MATRIX * sum(copies for _, copies in sizes), np.float64)
    Counts(
        sum(vertices * copies for (vertices, _), copies in sizes),
        sum(triangles * copies for (_, triangles), copies in sizes),
        0,  # no node is in several places
    ).check()
    return joined(meshes.part(drawn) for drawn in scene.drawn)


class Meshes:
    """The meshes of a document, each read once."""

    def __init__(self, document: Document, scene: Scene) -> None:
        """Read nothing yet."""
        self._document, self._scene = document, scene
        self._primitives: dict[int, list[Primitive]] = {}
        self._shapes: dict[int, list[Shape]] = {}  # at rest, one per primitive
        self._rigid: dict[int, Shape] = {}  # whole meshes that no node poses
        self._joints: dict[int, tuple[Matrix, bool]] = {}  # of skins: matrices, and whether all mirror

    def size(self, drawn: Drawn) -> tuple[int, int]:
        """Vertices and triangles of the mesh that a node draws."""
        if drawn.mesh not in self._primitives:
            self._primitives[drawn.mesh] = list(primitives(self._document, drawn.mesh, drawn.place))
        found = self._primitives[drawn.mesh]
        return sum(one.positions.count for one in found), sum(one.triangles for one in found)

    def part(self, drawn: Drawn) -> Part:
        """Vertices (n,3), corners (f,3) and matrices (k,4,4) of the k copies of a mesh that a node draws."""
        if "skin" in drawn.node:  # joints move the vertices to the world, whatever moves the node
            return *self._posed(drawn), IDENTITY[None]
        if "weights" in drawn.node:
            return *self._posed(drawn), drawn.matrices(self._document)
        if drawn.mesh not in self._rigid:
            self._rigid[drawn.mesh] = self._posed(drawn)
        return *self._rigid[drawn.mesh], drawn.matrices(self._document)

    def _posed(self, drawn: Drawn) -> Shape:
        """The mesh by the node's or its own weights and by the node's skin."""
        document, mesh = self._document, self._primitives[drawn.mesh]
        if drawn.mesh not in self._shapes:
            self._shapes[drawn.mesh] = [(points(document, one), triangles(document, one)) for one in mesh]
        skin = index_of(drawn.node, "skin", drawn.place)
        joints, mirrored = (None, False) if skin is None else self._skin(skin, drawn.place)
        weights = default_weights(document.item("meshes", drawn.mesh, drawn.place), drawn.node, drawn.place)
        vertices: list[NDArray[Any]] = [np.empty((0, 3), np.float32)]
        corners = [np.empty((0, 3), np.int32)]
        start = 0
        for one, (rest, listed) in zip(mesh, self._shapes[drawn.mesh], strict=True):
            moved = morphed(document, rest, one.fields, weights, one.place)
            vertices.append(
                moved if joints is None else skinned(document, moved, one.fields, joints, one.place)
            )
            corners.append(listed + np.int32(start))
            start += len(rest)
        order = [0, 2, 1] if mirrored else [0, 1, 2]
        return np.concatenate(vertices), np.concatenate(corners)[:, order]

    def _skin(self, skin: int, place: str) -> tuple[Matrix, bool]:
        if skin not in self._joints:
            matrices = joint_matrices(self._document, self._scene, skin, place)
            self._joints[skin] = matrices, bool((np.linalg.det(matrices[:, :3, :3]) < 0).all())
        return self._joints[skin]


def primitives(document: Document, mesh: int, place: str) -> Iterator[Primitive]:
    """The primitives of a mesh that have triangles: not those of points and lines or without positions."""
    for at, fields in enumerate(
        objects(document.item("meshes", mesh, place), "primitives", f"meshes[{mesh}]")
    ):
        here = f"meshes[{mesh}].primitives[{at}]"
        mode = whole(fields, "mode", here, LISTS)
        if mode > FAN:
            raise ValueError(f"{here}: mode: expected 0 to {FAN}, found {mode}")
        if mode < LISTS:
            continue
        if is_compressed(document, fields, here):
            unpack(document, fields, here)
        position = index_of(members(fields, "attributes", here), "POSITION", here)
        if position is None:  # section 3.7.2.1: not drawn
            continue
        positions = describe(document, position, f"{here}: POSITION", "VEC3")
        index = index_of(fields, "indices", here)
        indices = None if index is None else describe(document, index, f"{here}: indices", "SCALAR")
        if indices is not None and (indices.dtype.kind != "u" or indices.normalized):
            raise ValueError(
                f"{indices.place}: componentType: expected unsigned integers for {here}: indices"
            )
        count = positions.count if indices is None else indices.count
        if count % 3 if mode == LISTS else count < 3:
            wanted = "a multiple of 3" if mode == LISTS else "at least 3"
            raise ValueError(
                f"{here}: mode {mode}: expected {wanted} vertices, found {count}: the file is damaged"
            )
        yield Primitive(here, fields, positions, indices, mode, count // 3 if mode == LISTS else count - 2)


def points(document: Document, primitive: Primitive) -> NDArray[Any]:
    """The positions of a primitive in its mesh, as floats."""
    array = values(document, primitive.positions)
    return array if array.dtype.kind == "f" else array.astype(np.float64)


def triangles(document: Document, primitive: Primitive) -> NDArray[np.int32]:
    """The corners (f,3) of a primitive's triangles, strips and fans taken apart as section 3.7.2.1 has it."""
    count = primitive.positions.count
    if primitive.indices is None:
        order = np.arange(count, dtype=np.int32)
    else:
        listed = values(document, primitive.indices)[:, 0]
        most = int(listed.max(initial=0))
        if most == np.iinfo(listed.dtype).max:
            raise ValueError(
                f"{primitive.indices.place}: has the index {most}, which restarts a primitive and is not "
                "allowed: export each strip as a primitive of its own, or write indices in a wider type"
            )
        if most >= count and len(listed):
            raise ValueError(
                f"{primitive.indices.place}: has the index {most}, expected at most {count - 1} for {count} "
                "positions: the file is damaged"
            )
        order = listed.astype(np.int32)
    if primitive.mode == LISTS:
        return order.reshape(-1, 3)
    if primitive.mode == FAN:
        return fan(order)[:, [1, 2, 0]]
    return strip(order)
