"""The mesh over a grid of heights."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive._internal import arguments
from wive._internal.host_arrays import host_array
from wive._internal.precision import FLOAT64, Floats, real_asked, real_of
from wive._internal.room import expect_room
from wive._internal.scalars import MOST_COUNT

# The corners of a cell's two triangles, which share the diagonal from its first vertex to its last, as (row,
# column): counter-clockwise from above if both axes ascend.
HALVES = (((0, 0), (0, 1), (1, 1)), ((0, 0), (1, 1), (1, 0)))


def heightfield_mesh(
    z: ArrayLike, x: ArrayLike, y: ArrayLike, accuracy: str, dtype: DTypeLike | None = None
) -> tuple[Floats, NDArray[np.int32]]:
    """Vertices (rows * columns, 3), row by row, and faces (2 * cells, 3) with normals upwards.

    A cell with a corner that is NaN keeps its two faces, without an area. Of `dtype`; if that is None, of
    float64 if an argument is an array of float64, or for accuracy "exact", which refuses what float32 doesn't
    hold; else of float32.
    """
    asked = None if dtype is None else real_asked(dtype, accuracy)
    heights = _numbers("z", z)
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ValueError(f"z must have shape (rows, columns), at least (2, 2), got {heights.shape}")
    rows, columns = heights.shape
    if 2 * (rows - 1) * (columns - 1) > MOST_COUNT:
        raise ValueError(
            f"z must have at most {MOST_COUNT // 2} cells, got {heights.shape}: split it into tiles"
        )
    infinite = np.isinf(heights)
    if infinite.any():
        row, column = np.unravel_index(np.argmax(infinite), heights.shape)
        raise ValueError(
            f"z must be finite, or NaN or masked for holes, got {heights[row, column]} at [{row}, {column}]"
        )
    is_long = accuracy == "exact" or any(map(_is_float64, (z, x, y)))
    chosen = np.dtype(np.float64 if is_long else np.float32) if asked is None else asked.dtype
    across, along = _axis("x", x, columns, "column", chosen), _axis("y", y, rows, "row", chosen)
    expect_room(3 * heights.size, chosen)
    vertices = np.empty((rows, columns, 3), chosen)
    with np.errstate(over="ignore"):  # the scene refuses what is infinite in its precision
        vertices[..., 0], vertices[..., 1], vertices[..., 2] = across, along[:, None], heights
    turned = (across[0] < across[-1]) != (along[0] < along[-1])
    return vertices.reshape(-1, 3), _faces(~np.isnan(heights), turned)


def _faces(known: NDArray[np.bool_], turned: bool) -> NDArray[np.int32]:
    rows, columns = known.shape
    expect_room(2 * 3 * known.size, np.int32)
    numbers = np.arange(known.size, dtype=np.int32).reshape(rows, columns)
    faces = np.empty((rows - 1, columns - 1, 2, 3), np.int32)
    for half, corners in enumerate(HALVES):
        for k, (row, column) in enumerate(corners[:: -1 if turned else 1]):
            faces[:, :, half, k] = numbers[row : rows - 1 + row, column : columns - 1 + column]
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]
    if not whole.any():
        return np.empty((0, 3), np.int32)
    faces[~whole] = np.argmax(known)
    return faces.reshape(-1, 3)


def _axis(name: str, value: ArrayLike, count: int, what: str, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The coordinate of each row or column, which may not become equal to the next one as `dtype`."""
    axis = _numbers(name, value)
    if axis.shape != (count,):
        hint = ": pass one row or column of the grid" if axis.ndim == 2 else ""
        raise ValueError(f"{name} must have shape ({count},), one per {what} of z, got {axis.shape}{hint}")
    if not np.isfinite(axis).all():
        place = int(np.argmin(np.isfinite(axis)))
        raise ValueError(f"{name} must be finite, got {axis[place]} at {place}")
    steps = np.sign(np.diff(axis.astype(np.float64)))
    wrong = (steps == 0) | (steps != steps[0])
    if wrong.any():
        place = int(np.argmax(wrong)) + 1
        raise ValueError(
            f"{name} must ascend or descend from {what} to {what}, got {axis[place]} after {axis[place - 1]} "
            f"at {place}"
        )
    with np.errstate(over="ignore"):
        rounded = axis.astype(dtype)
    equal = (rounded[1:] == rounded[:-1]) & np.isfinite(rounded[1:])
    if equal.any():
        place = int(np.argmax(equal)) + 1
        raise ValueError(
            f"{name} must differ from {what} to {what} in {dtype}, the scene's precision, got "
            f"{axis[place - 1]} and {axis[place]} at {place}, both {rounded[place]}: "
            f"subtract a number from {name}, or make a float64 scene"
        )
    return axis


def _numbers(name: str, value: ArrayLike) -> NDArray[Any]:
    """Real numbers of any shape, NaN if masked."""
    return arguments.nan_if_masked(arguments.array_of_numbers(name, host_array(name, value)))


def _is_float64(value: Any) -> bool:
    """As of vertices: an array of float64, no list of numbers."""
    if isinstance(value, list | tuple):
        return False
    return real_of(np.asarray(host_array("", value)).dtype, "fast") is FLOAT64
