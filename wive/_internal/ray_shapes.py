"""Rays of any leading shape, such as those of a picture, (h,w,3): queries trace them as (n,3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from wive._internal import arguments
from wive._internal.arrays import NUMPY, Library
from wive._internal.rays import NAMES, Rays
from wive._internal.room import expect_room
from wive._internal.shapes import Shape, has_many_axes, reshaped, shape_of

# The axes at the end of origins, directions, tmin and tmax that hold one ray's numbers.
OF_ONE_RAY: tuple[Shape, ...] = ((3,), (3,), (), ())


def flat_rays(rays: Rays) -> tuple[Rays, Shape]:
    """The same rays as (n,3) and (n,), and the leading shape that they were given in.

    Raises ValueError unless origins and directions have one shape, or one of them is (3,), and limits are
    numbers or of that leading shape.
    """
    given = list(zip(NAMES, rays[:4], rays.libraries, strict=True))
    arrays = [numeric_array(*one) for one in given]
    shapes = [shape_of(name, array, library) for (name, _, library), array in zip(given, arrays, strict=True)]
    leading = _leading_of(NAMES[:2], shapes[:2], "rays")
    for name, shape in zip(NAMES[2:], shapes[2:], strict=True):
        if shape not in ((), leading):
            raise ValueError(
                f"{name} must be one number or have shape {leading}, one per ray, got shape {shape}"
            )
    origins, directions, tmin, tmax = (
        flattened(array, library, shape, tail)
        for array, library, shape, tail in zip(arrays, rays.libraries, shapes, OF_ONE_RAY, strict=True)
    )
    return Rays(origins, directions, tmin, tmax, rays.library, rays.libraries), leading


def flat_ends(a: Any, b: Any) -> tuple[Any, Any, Shape | None]:
    """Ends of segments in NumPy's arrays as (n,3), or (3,) for all, and their leading shape; None if flat."""
    if not (has_many_axes(a, NUMPY) or has_many_axes(b, NUMPY)):
        return a, b, None
    first, second = numeric_array("a", a, NUMPY), numeric_array("b", b, NUMPY)
    leading = _leading_of(("a", "b"), (np.shape(first), np.shape(second)), "segments")
    one, other = (flattened(end, NUMPY, np.shape(end), (3,)) for end in (first, second))
    return one, other, leading


def flat_places(prim: Any, uv: Any, directions: Any) -> tuple[Any, Any, Any, Shape | None]:
    """Triangles (n,), uv (n,2) and directions (n,3) in NumPy's arrays, and their leading shape; None if flat.

    One uv (2,) and one direction (3,) stay. Raises ValueError for shapes that don't fit together.
    """
    if not has_many_axes([prim], NUMPY):
        return prim, uv, directions, None
    prims = numeric_array("prim", prim, NUMPY)
    leading = np.shape(prims)
    rows = []
    for name, value, tail in (("uv", uv, (2,)), ("directions", directions, (3,))):
        array = numeric_array(name, value, NUMPY)
        shape, expected = np.shape(array), (*leading, *tail)
        if shape not in (tail, expected):
            raise ValueError(f"{name} must have shape {expected}, one row per prim, or {tail}, got {shape}")
        rows.append(flattened(array, NUMPY, shape, tail))
    return flattened(prims, NUMPY, leading, ()), rows[0], rows[1], leading


def flat_directions(value: Any, library: Library, leading: Shape) -> Any:
    """Directions (*leading, 3) as (n,3); (3,) stays. Raises ValueError for any other shape."""
    array = numeric_array("directions", value, library)
    shape = shape_of("directions", array, library)
    if shape not in ((3,), (*leading, 3)):
        raise ValueError(f"directions must have shape {(*leading, 3)}, one per hit, or (3,), got {shape}")
    return flattened(array, library, shape, (3,))


def _leading_of(names: Sequence[str], shapes: Sequence[Shape], what: str) -> Shape:
    """The leading shape of two arrays of vectors, which is one, or one of them is (3,)."""
    for name, shape in zip(names, shapes, strict=True):
        if shape[-1:] != (3,):
            raise ValueError(f"{name} must have shape (..., 3), one vector per {what[:-1]}, got {shape}")
    one, other = shapes
    if one != other and (3,) not in (one, other):
        raise ValueError(
            f"{names[0]} and {names[1]} must have one shape, or one of them (3,) if all {what} share it, "
            f"got {one} and {other}"
        )
    return max(one, other, key=len)[:-1]


def numeric_array(name: str, value: Any, library: Library) -> Any:
    """The array; lists and the like as NumPy's."""
    if library is not NUMPY or isinstance(value, np.ndarray | float | int | np.generic):
        return value
    return arguments.array_of_numbers(name, value)


def flattened(array: Any, library: Library, shape: Shape, tail: Shape, at_least_one: bool = False) -> Any:
    """The array with one axis in place of the leading ones; what all rays share stays.

    `at_least_one`: a single row is shared by none, and gets an axis as well.
    """
    if shape == tail and not at_least_one:
        return array
    if library is NUMPY and not array.flags.c_contiguous:
        expect_room(array.size, array.dtype)
    return reshaped(array, library, (math.prod(shape[: len(shape) - len(tail)]), *tail))
