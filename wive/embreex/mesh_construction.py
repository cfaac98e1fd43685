"""The meshes of embreex's scenes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments, mesh_arguments
from wive._internal.precision import FLOAT32, Floats
from wive.embreex.rtcore_scene import EmbreeScene

# The triangles of an element by its number of corners, in embreex's order, on which primID depends.
TRIANGLES = {
    4: ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
    8: (
        (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
        (1, 2, 6), (1, 6, 5), (0, 7, 3), (0, 4, 7), (3, 6, 2), (3, 7, 6),
    ),
}  # fmt: skip


class TriangleMesh:
    """A mesh of triangles, added to a scene.

    Triangles with a corner that is NaN or infinite are never hit.
    """

    def __init__(self, scene: EmbreeScene, vertices: ArrayLike, indices: ArrayLike | None = None) -> None:
        """Add the mesh. Arrays are copied.

        Arguments:
            scene: the scene.
            vertices: (v,3) real numbers, taken as float32; without indices (f,3,3), the corners of triangles.
            indices: (f,3) integers, three vertices per triangle.

        Raises ValueError or TypeError, in one line naming the argument; nothing is added then.
        """
        if indices is None:
            vertices = _corners(vertices)
            indices = np.arange(len(vertices)).reshape(-1, 3)
        points = arguments.vectors("vertices", vertices, FLOAT32, may_be_one=False)
        _add(scene, points, mesh_arguments.indices("indices", indices, len(points), (3,)))


class ElementMesh(TriangleMesh):
    """A mesh of tetrahedra or hexahedra, added to a scene as their triangles, 4 or 12 per element."""

    def __init__(self, scene: EmbreeScene, vertices: ArrayLike, indices: ArrayLike) -> None:
        """Add the mesh. Arrays are copied.

        Arguments:
            scene: the scene.
            vertices: (v,3) real numbers, taken as float32.
            indices: (e,4) integers, the corners of tetrahedra, or (e,8) of hexahedra: those of one face, and
                then those of the opposite face in the same order.

        Raises ValueError or TypeError, in one line naming the argument; nothing is added then.
        """
        points = arguments.vectors("vertices", vertices, FLOAT32, may_be_one=False)
        corners = mesh_arguments.indices("indices", indices, len(points), tuple(TRIANGLES))
        _add(scene, points, corners[:, TRIANGLES[corners.shape[1]]].reshape(-1, 3))


def _corners(triangles: ArrayLike) -> NDArray[Any]:
    """The corners (3f,3) of triangles (f,3,3)."""
    try:
        shape: object = np.shape(triangles)
    except ValueError:
        shape = "rows of unequal length"
    if not isinstance(shape, tuple) or shape[1:] != (3, 3):
        raise ValueError(
            f"vertices without indices must have shape (f, 3, 3), three corners per triangle, got {shape}"
        )
    return np.reshape(triangles, (-1, 3))


def _add(scene: EmbreeScene, points: Floats, triangles: NDArray[np.int32]) -> None:
    """Add copies of the arrays to the scene."""
    if not isinstance(scene, EmbreeScene):
        raise TypeError(f"scene must be an EmbreeScene of wive.embreex, got {type(scene).__name__}")
    finite = np.asarray(np.isfinite(points).all(axis=1))
    whole = np.asarray(finite[triangles].all(axis=1))
    scene.add(
        np.where(finite[:, None], points, np.float32(0)), np.where(whole[:, None], triangles, np.int32(0))
    )
