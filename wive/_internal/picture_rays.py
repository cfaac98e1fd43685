"""Rays through the centres of a picture's pixels, (h,w,3), top row first."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wive._internal import arguments
from wive._internal.picture import LARGEST_SIDE
from wive._internal.precision import Floats, real_named
from wive._internal.room import expect_room

Float64 = NDArray[np.float64]


def size_of(width: int, height: int, most: int = LARGEST_SIDE) -> tuple[int, int]:
    """Width and height, checked."""
    return arguments.integer("width", width, 1, most), arguments.integer("height", height, 1, most)


def pixel_centres(count: int) -> Float64:
    """(count,) centres of pixels on an axis from -1 to 1."""
    return (2 * np.arange(count) + 1) / count - 1


def perspective(frame: Float64, width: int, height: int, dtype: DTypeLike) -> tuple[Floats, Floats]:
    """The rays from frame[0] through frame[1] + x frame[2] + y frame[3], x and y from -1 to 1, y upwards."""
    eye, centre, right, top = frame
    return rays_of(eye, centre + plane(right, top, width, height), dtype)


def plane(right: Float64, top: Float64, width: int, height: int) -> Float64:
    """(h,w,3) vectors from the picture's centre to those of its pixels."""
    expect_room(2 * 3 * width * height, np.float64)
    across, upward = pixel_centres(width)[:, None] * right, pixel_centres(height)[::-1, None] * top
    return np.asarray(upward[:, None] + across)


def rays_of(origins: Float64, directions: Float64, dtype: DTypeLike) -> tuple[Floats, Floats]:
    """Origins and directions (h,w,3), one of which may be (3,), as arrays of that dtype and shape."""
    real: np.dtype[Any] = real_named(dtype).dtype
    shape = np.broadcast_shapes(origins.shape, directions.shape)
    expect_room(2 * 3 * int(np.prod(shape[:-1], dtype=np.int64)), real)
    filled = np.empty(shape, real), np.empty(shape, real)
    with np.errstate(over="ignore"):
        filled[0][:], filled[1][:] = origins, directions
    return filled
