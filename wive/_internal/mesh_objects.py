"""Meshes of other libraries: those of trimesh, PyVista and Open3D, and all objects with vertices and faces.

They are known by their attributes; no library is imported.
"""

from __future__ import annotations

import operator
import os
from typing import Any, Protocol

import numpy as np

from wive._internal.arrays import NUMPY, library_of
from wive._internal.host_arrays import host_array
from wive._internal.scalars import shown


class VerticesAndFaces(Protocol):
    """A mesh such as `trimesh.Trimesh`."""

    @property
    def vertices(self) -> Any:
        """(v,3) real numbers."""

    @property
    def faces(self) -> Any:
        """(f,3) integers."""


class VerticesAndTriangles(Protocol):
    """A mesh such as `open3d.geometry.TriangleMesh`."""

    @property
    def vertices(self) -> Any:
        """(v,3) real numbers."""

    @property
    def triangles(self) -> Any:
        """(f,3) integers."""


class PointsAndFaces(Protocol):
    """A mesh such as `pyvista.PolyData`."""

    @property
    def points(self) -> Any:
        """(v,3) real numbers."""

    @property
    def faces(self) -> Any:
        """Integers: 3, i, j, k for each triangle, one after another."""


class VertexAndTriangle(Protocol):
    """A mesh such as `open3d.t.geometry.TriangleMesh`."""

    @property
    def vertex(self) -> Any:
        """(v,3) real numbers under "positions"."""

    @property
    def triangle(self) -> Any:
        """(f,3) integers under "indices"."""


class PlacedMeshes(Protocol):
    """Meshes in places, such as `trimesh.Scene`."""

    @property
    def geometry(self) -> Any:
        """Meshes by name."""

    @property
    def graph(self) -> Any:
        """`nodes_geometry`, and by node its matrix (4,4) to the world and the name of its mesh."""


MeshObject = VerticesAndFaces | VerticesAndTriangles | PointsAndFaces | VertexAndTriangle


# Attributes that hold vertices and triangles.
# `faces` comes before `triangles`: those of trimesh are coordinates.
PAIRS = ("vertices", "faces"), ("points", "faces"), ("vertices", "triangles")
# What makes one triangle mesh of an object that is none, by a method that such objects have.
MENDS = {
    "extract_surface": "extract_surface().triangulate()",  # PyVista's grids and blocks
}


def is_placed(mesh: Any) -> bool:
    """Whether it is a scene such as `trimesh.Scene`: meshes in `geometry`, placed by the nodes of `graph`."""
    return not isinstance(mesh, type) and hasattr(mesh, "geometry") and hasattr(mesh, "graph")


def mesh_arrays(mesh: Any) -> tuple[Any, Any]:
    """Copies of the mesh's vertices and (f,3) faces: the mesh may change, and free its memory.

    Raises TypeError if the object is no mesh, ValueError if its faces aren't triangles.
    """
    if not isinstance(mesh, type):
        for names in PAIRS:
            if all(hasattr(mesh, name) for name in names):
                vertices, faces = (_copied(name, getattr(mesh, name)) for name in names)
                return vertices, _unpadded(mesh, faces) if names[0] == "points" else faces
        if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
            return _in_tensors(mesh.vertex, "positions"), _in_tensors(mesh.triangle, "indices")
    raise TypeError(_no_mesh(mesh))


def _copied(name: str, value: Any) -> Any:
    """A copy of any library's array; what is no array comes back as it is, to be refused by name."""
    if library_of(value) is NUMPY and hasattr(value, "numpy"):  # a tensor without DLPack
        value = value.numpy()
    array = host_array(name, value)
    if isinstance(array, (list, tuple)):  # lists have no dtype
        return array
    try:
        copy = np.array(array, subok=True)  # masked arrays stay masked, and are refused
    except Exception:  # of `__array__`, which raises anything
        return array
    return array if copy.dtype == object else copy


def _unpadded(mesh: Any, cells: Any) -> Any:
    """The corners i, j, k of cells given as 3, i, j, k, ...; ValueError if there are other cells."""
    if np.ndim(cells) != 1:
        return cells
    polygons = len(cells) % 4 != 0 or np.any(cells[::4] != 3)
    without_faces = len(cells) == 0 and getattr(mesh, "n_cells", 0) > 0
    if polygons or without_faces or getattr(mesh, "n_strips", 0) > 0:
        raise ValueError(
            f"faces of a {kind_of(mesh)} must be triangles, got "
            f"{'none' if without_faces else 'polygons'}: "
            "wive.Scene(mesh.triangulate()) takes polygons and strips as triangles"
        )
    return cells.reshape(-1, 4)[:, 1:]


def _in_tensors(tensors: Any, name: str) -> Any:
    """A copy of the tensor of this name, an item or an attribute."""
    for read in operator.getitem, getattr:
        try:
            tensor = read(tensors, name)
        except (AttributeError, KeyError, TypeError):
            continue
        return _copied(name, tensor)
    raise TypeError(f"the mesh must have vertex positions and triangle indices, got no {name}")


def kind_of(mesh: object) -> str:
    """The object's class as users write it."""
    kind = type(mesh)
    return f"{kind.__module__.partition('.')[0]}.{kind.__name__}".removeprefix("builtins.")


def _is_whole_mesh(item: Any) -> bool:
    """Whether an item of a list is a mesh object, or vertices and faces, and not a row of numbers."""
    if isinstance(item, (list, tuple)):
        return len(item) == 2 and all(map(_is_table, item))
    return hasattr(item, "vertex") or any(all(hasattr(item, name) for name in names) for names in PAIRS)


def _is_table(value: Any) -> bool:
    """Whether a value has rows: an array of two axes, or a list of lists."""
    if isinstance(value, (list, tuple)):
        return len(value) > 0 and isinstance(value[0], (list, tuple, np.ndarray))
    return getattr(value, "ndim", 0) == 2


def _no_mesh(mesh: Any) -> str:
    """Why an object is no mesh."""
    if isinstance(mesh, (str, bytes, os.PathLike)):
        return f"faces must be given with vertices, got {shown(mesh)} alone: wive.Scene.from_file reads files"
    if isinstance(mesh, (list, tuple)) and mesh and all(map(_is_whole_mesh, mesh)):
        return "the mesh must be one mesh, got a list of meshes: take wive.Scene.from_meshes(meshes)"
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return "faces must be given with vertices, got a tuple of both: wive.Scene(*mesh)"
    if isinstance(mesh, (np.ndarray, list, tuple)) or library_of(mesh) is not NUMPY:
        if getattr(mesh, "shape", ())[1:] == (3, 3):
            return (
                "faces must be given with vertices, got corners of triangles (n, 3, 3) alone: "
                "wive.Scene(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))"
            )
        return "faces must be given with vertices, got an array alone: wive.Scene(vertices, faces)"
    if is_placed(mesh):
        return f"the mesh must be one triangle mesh, got a {kind_of(mesh)}: take wive.Scene.from_meshes(mesh)"
    for method, mend in MENDS.items():
        if hasattr(mesh, method) and not isinstance(mesh, type):
            return f"the mesh must be one triangle mesh, got a {kind_of(mesh)}: take wive.Scene(mesh.{mend})"
    got = f"the class {mesh.__name__}" if isinstance(mesh, type) else kind_of(mesh)
    return f"the mesh must have vertices and faces, got {got}: wive.Scene(vertices, faces) takes arrays"
