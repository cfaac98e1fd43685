"""Meshes with a colour per corner of each triangle, and what a picture takes of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.colours import Colours
from wive._internal.room import expect_room


class Painted(NamedTuple):
    """A mesh of so many vertices, its triangles (f,3), and their colours (f,3,3), NaN for none."""

    vertices: int
    triangles: NDArray[np.int32]
    corners: Colours


def of_copies(copies: list[Painted]) -> Colours | None:
    """Colours of the vertices or triangles of meshes, in order; None if they have none.

    (v,3) if colours change within triangles and all corners at a vertex agree. Else (f,1,3), of each triangle
    the mean of its corners, which is the mean of the colours that change evenly between them.
    """
    meshes = {id(mesh): mesh for mesh in copies}
    if not any(np.isfinite(mesh.corners).any() for mesh in meshes.values()):
        return None
    if any((mesh.corners[:, :1] != mesh.corners[:, 1:]).any() for mesh in meshes.values()):
        of_vertices = {key: _of_vertices(mesh) for key, mesh in meshes.items()}
        if all(found is not None for found in of_vertices.values()):
            expect_room(3 * sum(mesh.vertices for mesh in copies), np.float64)
            return np.concatenate([of_vertices[id(mesh)] for mesh in copies])
    expect_room(3 * sum(len(mesh.corners) for mesh in copies), np.float64)
    means = {key: mesh.corners.mean(axis=1, keepdims=True) for key, mesh in meshes.items()}
    return np.concatenate([means[id(mesh)] for mesh in copies])


def _of_vertices(mesh: Painted) -> Colours | None:
    """(v,3), NaN if no triangle uses a vertex; None if two of them differ at one."""
    colours = np.full((mesh.vertices, 3), np.nan)
    colours[mesh.triangles] = mesh.corners
    return colours if np.array_equal(colours[mesh.triangles], mesh.corners, equal_nan=True) else None
