"""The meshes that a scene was made of: which of its triangles and vertices are whose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wive._internal.read_only import ReadOnly


class Geoms(ReadOnly):
    """The g meshes of a scene, numbered in the order in which they were given; `len` is g.

    Attributes:
        faces: (g+1,) int32, the triangles of mesh i are rows faces[i] to faces[i+1] of `scene.faces`.
        vertices: (g+1,) int32, its vertices are rows vertices[i] to vertices[i+1] of `scene.vertices`.

    >>> first, last = scene.geoms.faces[i : i + 2]
    >>> faces = scene.faces[first:last] - scene.geoms.vertices[i]  # as mesh i was given
    """

    faces: NDArray[np.int32]
    vertices: NDArray[np.int32]

    def __init__(self, faces: NDArray[np.int32], vertices: NDArray[np.int32]) -> None:
        """Keep the offsets, read-only."""
        for offsets in (faces, vertices):
            offsets.flags.writeable = False
        vars(self).update(faces=faces, vertices=vertices)

    def of(self, prim: NDArray[np.int32]) -> NDArray[np.int32]:
        """The mesh of each triangle `prim` of the scene; -1 for -1."""
        if len(self) == 1:
            return np.minimum(prim, np.int32(0))
        return np.asarray(np.searchsorted(self.faces[:-1], prim, side="right") - 1, np.int32)

    def within(self, prim: NDArray[np.int32]) -> NDArray[np.int32]:
        """The number of each triangle `prim` of the scene within its mesh; -1 for -1."""
        if len(self) == 1:
            return prim
        return np.where(prim >= 0, prim - self.faces[self.of(prim)], np.int32(-1))

    def __len__(self) -> int:
        """Number of meshes."""
        return len(self.faces) - 1

    def __repr__(self) -> str:
        """Number of meshes."""
        return f"Geoms({len(self)} meshes)"


def one_geom(faces: int, vertices: int) -> Geoms:
    """The only mesh of a scene."""
    return Geoms(np.array([0, faces], np.int32), np.array([0, vertices], np.int32))
