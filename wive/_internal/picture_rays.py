"""Rays through the centres of a picture's pixels, (h,w,3), top row first."""

from __future__ import annotations

import math
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
    return rays_of((eye,), plane(centre, right, top, width, height), dtype)


def plane(centre: Float64, right: Float64, top: Float64, width: int, height: int) -> tuple[Float64, Float64]:
    """(h,1,3) and (w,3): the sum is where the pixels are, on the plane that `right` and `top` span."""
    return centre + pixel_centres(height)[::-1, None, None] * top, pixel_centres(width)[:, None] * right


def rays_of(
    origins: tuple[Float64, ...], directions: tuple[Float64, ...], dtype: DTypeLike
) -> tuple[Floats, Floats]:
    """Origins and directions (h,w,3) of that dtype, each the sum of one or two arrays of like shapes."""
    real: np.dtype[Any] = real_named(dtype).dtype
    shape = np.broadcast_shapes(*(part.shape for part in origins + directions))
    expect_room(2 * math.prod(shape), real)
    rays = np.empty(shape, real), np.empty(shape, real)
    with np.errstate(over="ignore"):
        for array, parts in zip(rays, (origins, directions), strict=True):
            np.add(parts[0], parts[1] if len(parts) > 1 else 0.0, out=array, casting="same_kind")
    return rays
