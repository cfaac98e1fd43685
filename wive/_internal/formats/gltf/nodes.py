"""The node tree of a glTF scene: which mesh is drawn, in which order and by which matrices.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, sections 3.5 and 5.25.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wive._internal.formats.gltf.accessors import Accessor, describe, values
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.fields import (
    Fields,
    index_of,
    indices,
    listed,
    members,
    numbers,
    short,
    whole,
)
from wive._internal.formats.placing import IDENTITY, Matrix, affine

AT_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@dataclass(frozen=True)
class Drawn:
    """A mesh that a node draws, in as many copies as its instances have.

    `world` (4,4) is the node's matrix to the world; `instances` are the accessors of EXT_mesh_gpu_instancing.
    """

    mesh: int
    place: str
    node: Fields
    world: Matrix
    copies: int = 1
    instances: dict[str, Accessor] | None = None

    def matrices(self, document: Document) -> Matrix:
        """Matrices (k,4,4) of the copies, from the mesh to the world."""
        if self.instances is None:
            return self.world[None]
        parts = {
            key: values(document, self.instances[key]).astype(np.float64)
            if key in self.instances
            else np.tile(value, (self.copies, 1))
            for key, value in AT_REST.items()
        }
        return self.world @ composed(**parts, places=[f"{self.place}: EXT_mesh_gpu_instancing"] * self.copies)


class Scene:
    """The nodes of the document's scene, depth first, children in order, with their matrices to the world."""

    def __init__(self, document: Document) -> None:
        """Walk the nodes; raises ValueError if they are no trees."""
        visits = list(walk(document))
        worlds = local_matrices([visit.node for visit in visits], [visit.place for visit in visits])
        for at, visit in enumerate(visits):
            if visit.parent is not None:
                worlds[at] = worlds[visit.parent] @ worlds[at]
        self.worlds = {visit.number: world for visit, world in zip(visits, worlds, strict=True)}
        self.drawn: list[Drawn] = []
        for visit in visits:
            mesh = index_of(visit.node, "mesh", visit.place)
            if mesh is not None and visit.visible:
                copies, found = instances(document, visit.node, visit.place)
                world = self.worlds[visit.number]
                self.drawn.append(Drawn(mesh, visit.place, visit.node, world, copies, found))
        if "nodes" not in document.root and "scene" not in document.root:
            meshes = range(len(listed(document.root, "meshes", "document")))  # a library of meshes: each once
            self.drawn = [Drawn(mesh, "document", {}, IDENTITY) for mesh in meshes]


class Visit(NamedTuple):
    """A node on the walk: `parent` is its parent's visit, counted from 0; `visible` minds all ancestors."""

    number: int
    node: Fields
    place: str
    parent: int | None
    visible: bool


def walk(document: Document) -> Iterator[Visit]:
    """Each node of the scene, once."""
    first, place = roots(document)
    stack: list[tuple[int, str, int | None, bool]] = [(root, place, None, True) for root in reversed(first)]
    visited: set[int] = set()
    while stack:  # no recursion: a chain of nodes may be long
        index, place, parent, visible = stack.pop()
        node, here = document.item("nodes", index, place), f"nodes[{index}]"
        if index in visited:
            raise ValueError(
                f"{here}: is reached a second time, by {place}: expected trees, each node with one parent"
            )
        visible = visible and shown(node, here)
        yield Visit(index, node, here, parent, visible)
        children = indices(node, "children", here)
        stack += [(child, here, len(visited), visible) for child in reversed(children)]
        visited.add(index)


def roots(document: Document) -> tuple[list[int], str]:
    """The roots of the default scene, or of the first; without scenes, all nodes that are no child."""
    index = index_of(document.root, "scene", "document")
    if index is not None or listed(document.root, "scenes", "document"):
        index = index or 0
        return indices(
            document.item("scenes", index, "scene"), "nodes", f"scenes[{index}]"
        ), f"scenes[{index}]"
    nodes = range(len(listed(document.root, "nodes", "document")))
    children = {
        child for at in nodes for child in indices(document.item("nodes", at, ""), "children", f"nodes[{at}]")
    }
    first = [at for at in nodes if at not in children]
    if nodes and not first:
        raise ValueError("nodes: each is a child of another: expected trees, each node with one parent")
    return first, "document"


def local_matrices(nodes: list[Fields], places: list[str]) -> Matrix:
    """Matrices (n,4,4) from each node to its parent."""
    parts = {key: np.tile(np.array(value), (len(nodes), 1)) for key, value in AT_REST.items()}
    given = {}
    for at, (node, place) in enumerate(zip(nodes, places, strict=True)):
        moved = [key for key in AT_REST if key in node]
        for key in moved:
            parts[key][at] = numbers(node, key, place, len(AT_REST[key]))
        if "matrix" in node:
            if moved:
                raise ValueError(f"{place}: has both matrix and {moved[0]}, expected one of them")
            column_major = numbers(node, "matrix", place, 16).reshape(4, 4)
            given[at] = affine(column_major.T, f"{place}: matrix")
    result = composed(**parts, places=places)
    for at, matrix in given.items():
        result[at] = matrix
    return result


def composed(translation: Matrix, rotation: Matrix, scale: Matrix, places: list[str]) -> Matrix:
    """Matrices (n,4,4) that scale, then rotate by the quaternion x y z w, then translate."""
    length = np.sqrt((rotation * rotation).sum(axis=1))
    wrong = np.flatnonzero(~((length > 0) & np.isfinite(length)))
    if len(wrong):
        found = short(rotation[wrong[0]].tolist())
        raise ValueError(f"{places[wrong[0]]}: rotation: expected a quaternion of length 1, found {found}")
    x, y, z, w = (rotation / length[:, None]).T
    result = np.zeros((len(rotation), 4, 4))
    result[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], 1)
    result[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], 1)
    result[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], 1)
    result[:, :3, :3] *= scale[:, None, :]
    result[:, :3, 3] = translation
    result[:, 3, 3] = 1
    return result


def instances(document: Document, node: Fields, place: str) -> tuple[int, dict[str, Accessor] | None]:
    """How many copies a node draws, and the accessors that place them, if it has EXT_mesh_gpu_instancing."""
    extensions = members(node, "extensions", place)
    if "EXT_mesh_gpu_instancing" not in extensions:
        return 1, None
    here = f"{place}: EXT_mesh_gpu_instancing"
    if "skin" in node:
        raise ValueError(f"{here}: is not read together with a skin")
    attributes = members(members(extensions, "EXT_mesh_gpu_instancing", place), "attributes", here)
    found = {
        key: describe(document, index, f"{here}: {name}", f"VEC{len(value)}")
        for key, value in AT_REST.items()
        if (index := index_of(attributes, name := key.upper(), here)) is not None
    }
    others = [index_of(attributes, key, here) for key in attributes if key.lower() not in found]
    counts = {accessor.count for accessor in found.values()}
    counts |= {
        whole(document.item("accessors", index, here), "count", f"accessors[{index}]")
        for index in others
        if index is not None
    }
    if len(counts) != 1:
        raise ValueError(f"{here}: expected attributes of one count, found {short(sorted(counts))}")
    return counts.pop(), found


def shown(node: Fields, place: str) -> bool:
    """Whether a node lets itself and its children be seen (KHR_node_visibility)."""
    visibility = members(members(node, "extensions", place), "KHR_node_visibility", place)
    visible = visibility.get("visible", True)
    if not isinstance(visible, bool):
        raise ValueError(
            f"{place}: KHR_node_visibility: visible: expected true or false, found {short(visible)}"
        )
    return visible
