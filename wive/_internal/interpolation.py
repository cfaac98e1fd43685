"""Values given at vertices, at points of triangles."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments
from wive._internal.precision import FLOAT32, FLOAT64, Floats
from wive._internal.room import expect_room

# Rows at a time, so that what is computed on the way stays in the cache.
BLOCK = 1 << 14


def vertex_values_of(value: ArrayLike, count: int) -> Floats:
    """Values (count,) or (count,k) of `count` vertices: float32 if given in that or float16, else float64."""
    array = arguments.array_of_numbers("vertex_values", value)
    if array.ndim not in (1, 2) or len(array) != count:
        raise ValueError(
            f"vertex_values must have shape ({count},) or ({count}, k), one row per vertex, got {array.shape}"
        )
    real = FLOAT32 if array.dtype.kind == "f" and array.dtype.itemsize <= 4 else FLOAT64
    return real.array(arguments.nan_if_masked(array))


def interpolated(values: Floats, faces: NDArray[np.int32], prim: NDArray[np.int32], uv: Floats) -> Floats:
    """Values (v,) or (v,k) at uv (n,2) of triangles prim (n,), in their dtype; NaN if prim is no face."""
    rows = values[:, None] if values.ndim == 1 else values
    expect_room(len(prim) * rows.shape[1], values.dtype)
    answer = np.full((len(prim), rows.shape[1]), np.nan, values.dtype)
    for first in range(0, len(prim), BLOCK):
        block = slice(first, first + BLOCK)
        hit, corners = corners_of(faces, prim[block], len(values))
        u, v = uv[block][hit].astype(np.float64).T[:, :, None]
        a, b, c = (rows[corners[:, k]].astype(np.float64) for k in range(3))
        with np.errstate(over="ignore", invalid="ignore"):
            answer[block][hit] = (1 - u - v) * a + u * b + v * c
    return answer.reshape(len(prim), *values.shape[1:])


def corners_of(
    faces: NDArray[np.int32], prim: NDArray[np.int32], vertex_count: int
) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """The hits (h,) among `prim` (n,), and the vertices (h,3) of their triangles."""
    (hit,) = np.nonzero((prim >= 0) & (prim < len(faces)))
    corners = faces[prim[hit]]
    known = ((corners >= 0) & (corners < vertex_count)).all(axis=1)
    return hit[known], corners[known]
