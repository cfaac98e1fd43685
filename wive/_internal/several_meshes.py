"""Several meshes as one: their arrays joined, and new positions of one of them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive import _cpu
from wive._internal import arguments, mesh_arguments
from wive._internal.arrays import NUMPY, library_of
from wive._internal.formats.placing import affine, placed
from wive._internal.host_arrays import host_array
from wive._internal.mesh_objects import is_placed, kind_of, mesh_arrays
from wive._internal.precision import Floats, Real, real_asked
from wive._internal.room import expect_room
from wive._internal.scalars import MOST_COUNT, shown
from wive._internal.tracer import Tracer
from wive.geoms import Geoms

Mesh = tuple[Floats, NDArray[np.int32]]
Pair = tuple[ArrayLike, ArrayLike]
# Vertices and faces as they were given, and what errors name as the way to round vertices.
Given = tuple[Any, Any, str]


class Joined(NamedTuple):
    """The mesh of a scene that is made of several; None if it is one."""

    vertices: Any
    faces: Any
    geoms: Geoms | None


def join(meshes: Any, dtype: DTypeLike | None, accuracy: str) -> Joined:
    """Copies of all meshes, one after another, in the precision of the scene.

    That is float64 if `dtype` is None and one mesh's vertices are an array of float64. Raises ValueError or
    TypeError that names the mesh.
    """
    if dtype is not None:
        real_asked(dtype, accuracy)
    given = _all_given(meshes)
    parts = [_checked(i, mesh, accuracy, dtype) for i, mesh in enumerate(given)]
    if len({points.dtype for points, _ in parts}) > 1:  # numbers of lists are rounded once
        parts = [_checked(i, mesh, accuracy, np.float64) for i, mesh in enumerate(given)]
    offsets = [np.cumsum([0, *map(len, arrays)], dtype=np.int64) for arrays in zip(*parts, strict=True)]
    starts, first_faces = offsets
    for name, total in (("vertices", starts[-1]), ("triangles", first_faces[-1])):
        if total > MOST_COUNT:
            raise ValueError(
                f"meshes must have at most {MOST_COUNT} {name} in all, got {total}: make several scenes"
            )
    expect_room(3 * int(starts[-1]), parts[0][0].dtype)
    expect_room(3 * int(first_faces[-1]), np.int32)
    vertices = np.concatenate([points for points, _ in parts])
    faces = np.empty((int(first_faces[-1]), 3), np.int32)
    for (_, corners), row, start in zip(parts, first_faces.tolist(), starts.tolist(), strict=False):
        np.add(corners, np.int32(start), out=faces[row : row + len(corners)])
    geoms = Geoms(first_faces.astype(np.int32), starts.astype(np.int32))
    return Joined(vertices, faces, geoms if len(geoms) > 1 else None)


def name_the_mesh(joined: Joined) -> None:
    """Raise ValueError for the first mesh that makes no tree by itself, if there is one."""
    vertices, faces, geoms = joined
    if geoms is None:
        _make_alone("meshes[0]: ", vertices, faces)
        return
    for i in range(len(geoms)):
        _make_alone(f"meshes[{i}]: ", *_part(vertices, faces, geoms, i))


def moved_rows(geoms: Geoms, i: int, vertices: ArrayLike, real: Real) -> Floats:
    """New positions of mesh `i`; ValueError or TypeError if they aren't as many as before."""
    first, last = geoms.vertices[i : i + 2].tolist()
    return mesh_arguments.moved_vertices(vertices, last - first, real, f"those of mesh {i}")


def refitted_mesh(
    tracer: Tracer, faces: NDArray[np.int32], geoms: Geoms, i: int, rows: Floats, threads: int
) -> Tracer:
    """A tracer whose mesh `i` has its vertices at `rows`.

    Raises ValueError that names a vertex as it is numbered in that mesh.
    """
    first, last = geoms.vertices[i : i + 2].tolist()
    points = tracer.bvh.vertices
    expect_room(points.size, points.dtype)
    points = points.copy()
    points[first:last] = rows
    try:
        return tracer.refitted(arguments.read_only(points), threads)
    except ValueError:
        _make_alone("", *_part(points, faces, geoms, i))
        raise


def _part(vertices: Floats, faces: NDArray[np.int32], geoms: Geoms, i: int) -> Mesh:
    """Mesh i alone."""
    first, last = geoms.faces[i : i + 2].tolist()
    start, end = geoms.vertices[i : i + 2].tolist()
    return vertices[start:end], faces[first:last] - np.int32(start)


def _make_alone(name: str, vertices: Floats, faces: NDArray[np.int32]) -> None:
    """Raise what the core raises for a mesh: the one place that knows what vertices and faces must be."""
    try:
        _cpu.Bvh(vertices, faces, "watertight")
    except ValueError as error:
        raise ValueError(f"{name}{error}") from None


def _all_given(meshes: Any) -> list[Given]:
    """What was given for each mesh, in arrays of the host."""
    if is_placed(meshes):
        given = list(_of_nodes(meshes))
        if not given:
            raise ValueError(f"meshes must be at least one mesh, got a {kind_of(meshes)} that places none")
        return given
    is_list = isinstance(meshes, Iterable) and not isinstance(meshes, (str, bytes, Mapping, np.ndarray))
    if not is_list or library_of(meshes) is not NUMPY:
        raise TypeError(
            "meshes must be a list of meshes, each (vertices, faces) or a mesh object, "
            f"got {_described(meshes)}"
        )
    listed = meshes if isinstance(meshes, Sequence) else list(meshes)
    if len(listed) == 0:
        raise ValueError("meshes must be at least one mesh, got none: leave out scenes without meshes")
    return [_given(i, mesh) for i, mesh in enumerate(listed)]


def _given(i: int, mesh: Any) -> Given:
    """The vertices and faces of one item."""
    try:
        if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
            return host_array("vertices", mesh[0]), host_array("faces", mesh[1]), ""
        is_array = isinstance(mesh, (np.ndarray, tuple, list)) or library_of(mesh) is not NUMPY
        if is_array or isinstance(mesh, (str, bytes, os.PathLike)):
            raise TypeError(f"expected (vertices, faces) or a mesh object, got {_described(mesh)}")
        return *mesh_arrays(mesh), "dtype=np.float32"
    except (TypeError, ValueError) as error:
        _refuse(i, error)


def _of_nodes(scene: Any) -> Iterator[Given]:
    """The mesh of each node of a scene of trimesh, in the world, in float64.

    Mirrored meshes turn the other side of their triangles out, so that normals point as they do in the mesh.
    Paths and point clouds are meshes without triangles: numbers of meshes are those of nodes.
    """
    for i, node in enumerate(scene.graph.nodes_geometry):
        try:
            matrix, name = scene.graph[node]
            mesh = scene.geometry[name]
            if hasattr(mesh, "vertices") and not hasattr(mesh, "faces"):
                yield np.empty((0, 3)), np.empty((0, 3), np.int32), ""
                continue
            points, corners = mesh_arguments.mesh(*mesh_arrays(mesh), dtype=np.float64)
            world = affine(np.asarray(matrix, np.float64), f"transform of node {shown(node)}")
            mirrored = np.linalg.det(world[:3, :3]) < 0
        except (TypeError, ValueError) as error:
            _refuse(i, error)
        yield (
            placed(points, world[None])[0],
            corners[:, [0, 2, 1]] if mirrored else corners,
            "dtype=np.float32",
        )


def _checked(i: int, given: Given, accuracy: str, dtype: DTypeLike | None) -> Mesh:
    """A mesh as the core takes it; its faces index its own vertices."""
    vertices, faces, rounding = given
    try:
        points, corners = mesh_arguments.mesh(vertices, faces, accuracy, dtype, rounding)
        if corners.size and not 0 <= corners.min() <= corners.max() < len(points):
            _make_alone("", points, corners)
    except (TypeError, ValueError) as error:
        _refuse(i, error)
    return points, corners


def _refuse(i: int, error: TypeError | ValueError) -> NoReturn:
    """Raise the error with the number of the mesh before it."""
    kind = TypeError if isinstance(error, TypeError) else ValueError
    raise kind(f"meshes[{i}]: {error}") from error


def _described(value: Any) -> str:
    """What was given in place of a mesh or of a list of meshes, and what to do about it."""
    if isinstance(value, (str, bytes, os.PathLike)):
        return f"{shown(value)}: wive.load_mesh reads files"
    if isinstance(value, Mapping):
        return f"a {kind_of(value)}: take its values()"
    if isinstance(value, (tuple, list)):
        return f"a {kind_of(value)} of {len(value)}"
    if isinstance(value, np.ndarray) or library_of(value) is not NUMPY:
        return "an array alone: [(vertices, faces)] is a list of one mesh"
    return f"{kind_of(value)}: wive.Scene takes one mesh"
