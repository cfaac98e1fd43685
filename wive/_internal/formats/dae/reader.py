"""COLLADA: the triangles of the scene of a .dae file, in the order of its nodes.

Read by the standard library alone: pycollada, by which trimesh reads, rounds positions to float32, and
trimesh leaves out nodes that it does not understand, without a word.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wive._internal.formats import Mesh
from wive._internal.formats.dae.geometry import Geometry, read_geometry
from wive._internal.formats.dae.tree import Document, Element
from wive._internal.formats.named import named
from wive._internal.formats.placing import IDENTITY, NOTHING, Counts, Matrix, affine, joined

DRAWN = ("instance_geometry", "node", "instance_node", "instance_controller")


def read(data: bytes, name: str) -> Mesh:
    """Vertices (v,3), float64, and faces (f,3) of the scene: nodes depth first, in the order of the file.

    Each copy of a geometry has its own vertices, all of the geometry's. Unit and up axis are the file's.
    """
    with named(name):
        copies = Scene(Document(data), name).placed()
        return joined((one.shape.vertices, one.shape.triangles, one.matrix[None]) for one in copies)


class Copy(NamedTuple):
    """A geometry as an `instance_geometry` places it."""

    instance: Element
    geometry: Element
    shape: Geometry
    matrix: Matrix


class Scene:
    """The visual scene of a document."""

    def __init__(self, document: Document, name: str) -> None:
        """Find the scene."""
        self.document, self._name = document, name
        scene = document.root.first("scene")
        instance = None if scene is None else scene.first("instance_visual_scene")
        if instance is None:
            raise ValueError("COLLADA: has no scene, so no geometry is placed: export a scene")
        self._root = document.target(instance, "url", "visual_scene")
        self._geometries: dict[int, Geometry] = {}  # by id() of elements, as all below
        self._matrices: dict[int, Matrix] = {}
        self._counts: dict[int, Counts] = {}

    def placed(self) -> Iterator[Copy]:
        """All copies of geometries, in order."""
        self._count()
        self._counts[id(self._root)].check()
        stack: list[tuple[Element, Element, Matrix]] = [(self._root, self._root, IDENTITY)]
        while stack:
            instance, element, outer = stack.pop()
            if self._counts[id(element)] is NOTHING:  # nested empty nodes may have copies without number
                continue
            if element.tag == "geometry":
                yield Copy(instance, element, self._geometries[id(element)], outer)
                continue
            inner = self._matrices[id(element)]
            matrix = outer if inner is IDENTITY else outer @ inner
            stack += [(*held, matrix) for held in reversed(self._below(element))]

    def _below(self, node: Element) -> list[tuple[Element, Element]]:
        """What places the nodes and geometries that a node holds, and these, in order."""
        found = []
        for child in node.all(*DRAWN):
            if child.tag == "instance_controller":
                raise ValueError(
                    f"{child.place}: is moved by a skin or morph, which is not read: export the scene as "
                    "glTF, or with its modifiers applied"
                )
            if child.tag == "node":
                found.append((child, child))
            else:
                kind = child.tag.removeprefix("instance_")
                found.append((child, self.document.target(child, "url", kind)))
        return found

    def _count(self) -> None:
        """Count vertices and triangles below each node, and read geometries and matrices."""
        stack, entered = [self._root], set()
        while stack:  # no recursion: nodes may be nested deep
            element = stack[-1]
            key = id(element)
            if key in self._counts:
                stack.pop()
            elif element.tag == "geometry":
                one = self._geometries[key] = read_geometry(self.document, element, self._name)
                self._counts[key] = Counts.of(len(one.vertices), len(one.triangles))
            else:
                below = [held for _, held in self._below(element)]
                missing = {id(one): one for one in below if id(one) not in self._counts}
                if missing and key in entered:
                    raise ValueError(f"{element.place}: holds itself: the file is damaged")
                entered.add(key)
                stack += missing.values()
                if not missing:
                    self._counts[key] = Counts.of(0, 0, [self._counts[id(one)] for one in below])
                    if self._counts[key] is not NOTHING:  # others may be of cameras, with other transforms
                        self._matrices[key] = matrix_of(element)


def matrix_of(node: Element) -> Matrix:
    """The product of a node's transforms, in their order, from the node to its parent."""
    result = IDENTITY
    for child in node.all("matrix", "translate", "rotate", "scale", "lookat", "skew"):
        matrix = np.eye(4)
        if child.tag == "matrix":
            matrix = affine(child.numbers(16).reshape(4, 4), child.place)
        elif child.tag == "translate":
            matrix[:3, 3] = child.numbers(3)
        elif child.tag == "scale":
            matrix[:3, :3] = np.diag(child.numbers(3))
        elif child.tag == "rotate":
            matrix[:3, :3] = rotation(child)
        else:
            raise ValueError(f"{child.place}: is not read: export the node with a matrix")
        if not np.isfinite(matrix).all():
            raise ValueError(f"{child.place}: expected finite numbers")
        result = matrix if result is IDENTITY else result @ matrix
    return result


def rotation(element: Element) -> Matrix:
    """The rotation (3,3) about an axis by an angle in degrees (Rodrigues); quarter turns are exact."""
    *axis, degrees = element.numbers(4).tolist()
    if degrees == 0:
        return np.eye(3)
    length = float(np.linalg.norm(axis))
    if not (0 < length < np.inf and abs(degrees) < np.inf):
        raise ValueError(f"{element.place}: expected an axis and an angle, found {axis} and {degrees}")
    x, y, z = (value / length for value in axis)
    quarters, rest = divmod(degrees, 90)
    sine, cosine = np.sin(np.radians(rest)), np.cos(np.radians(rest))
    for _ in range(int(quarters % 4)):
        sine, cosine = cosine, -sine
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    along = np.outer([x, y, z], [x, y, z])
    return np.asarray(cosine * np.eye(3) + sine * across + (1 - cosine) * along)
