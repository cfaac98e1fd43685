"""Checks on vertices and faces that users pass. Every error is one line that names the argument."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive._internal.arguments import Int32, numeric
from wive._internal.precision import Floats, Real, real_asked, real_of
from wive._internal.room import expect_room
from wive._internal.scalars import MOST_COUNT


def mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    accuracy: str = "watertight",
    dtype: DTypeLike | None = None,
    rounding: str = "",
) -> tuple[Floats, Int32]:
    """Vertices (v,3) float32 or float64 and faces (f,3) int32, C-contiguous; such arrays are not copied.

    If `dtype` is None, that of the vertices decides. `rounding` is what errors name as the way to round.
    """
    asked = None if dtype is None else real_asked(dtype, accuracy)
    points = _positions(vertices)
    corners = numeric("faces", faces, "an (f, 3) array of integers", "iu", "round them to integer indices")
    if corners.shape == (0,):
        corners = corners.reshape(0, 3)
    if corners.ndim != 2 or corners.shape[1] != 3:
        raise ValueError(
            f"faces must have shape (f, 3), one row of three vertex indices per triangle, got {corners.shape}"
        )
    _expect_addressable("faces", corners)
    expect_room(corners.size, np.int32)
    fits = np.can_cast(corners.dtype, np.int32)
    # The core refuses indices out of range in the same words, but those beyond int32 would wrap on the way.
    if not fits and corners.size and (corners.min() < -MOST_COUNT - 1 or corners.max() > MOST_COUNT):
        face = int(np.argmax(((corners < 0) | (corners >= len(points))).any(axis=1)))
        raise ValueError(
            f"faces must index the {len(points)} vertices from 0, got {corners[face].tolist()} in face {face}"
        )
    if asked is None:
        # Lists have no dtype: NumPy's choice would depend on whether a number in them has a decimal point.
        given = np.dtype(np.float32) if isinstance(vertices, list | tuple) else points.dtype
        points = real_of(given, accuracy).taken("vertices", vertices, points, rounding)
    else:
        points = asked.array(points)
    return points, np.require(corners, np.int32, ["C", "A"])


def indices(name: str, value: ArrayLike, count: int, columns: tuple[int, ...]) -> Int32:
    """Rows (f,k) int32 of indices of `count` vertices, k one of `columns`."""
    shapes = " or ".join(f"(f, {number})" for number in columns)
    rows = numeric(name, value, f"an {shapes} array of integers", "iu", "round them to integer indices")
    if rows.ndim != 2 or rows.shape[1] not in columns:
        raise ValueError(f"{name} must have shape {shapes}, got {rows.shape}")
    _expect_addressable(name, rows)
    wrong = ((rows < 0) | (rows >= count)).any(axis=1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(
            f"{name} must index the {count} vertices from 0, got {rows[row].tolist()} in row {row}"
        )
    return rows.astype(np.int32)


def moved_vertices(vertices: ArrayLike, count: int, real: Real, whose: str = "the scene's own") -> Floats:
    """New positions (count,3) in the scene's dtype, C-contiguous; not copied if they are so already."""
    points = _positions(vertices)
    if len(points) != count:
        raise ValueError(
            f"vertices must have shape ({count}, 3), as {whose}, got {points.shape}: "
            "make a new Scene for another mesh"
        )
    return real.taken("vertices", vertices, points)


def triangles(name: str, value: ArrayLike, count: int) -> Int32:
    """Rows (n,) of `count` faces, or -1 for none."""
    array = numeric(name, value, "an (n,) array of integers", "iu", "round them to integer indices")
    if array.ndim != 1:
        raise ValueError(f"{name} must have shape (n,), one triangle per ray, got {array.shape}")
    if array.size and (array.min() < -1 or array.max() >= count):
        row = int(np.argmax((array < -1) | (array >= count)))
        raise ValueError(
            f"{name} must be rows of the {count} faces from 0, or -1 for none, "
            f"got {name}[{row}] = {array[row]}"
        )
    return array.astype(np.int32, copy=False)


def _positions(vertices: ArrayLike) -> NDArray[Any]:
    points = numeric("vertices", vertices, "a (v, 3) array of real numbers", "fiu")
    if points.shape == (0,):
        points = points.reshape(0, 3)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"vertices must have shape (v, 3), got {points.shape}")
    _expect_addressable("vertices", points)
    return points


def _expect_addressable(name: str, rows: NDArray[Any]) -> None:
    """Raise ValueError for more rows than 32-bit indices tell apart, before anything is done with them."""
    if len(rows) > MOST_COUNT:
        raise ValueError(
            f"{name} must be at most {MOST_COUNT} in one scene, got {len(rows)}: split the mesh into several"
        )
