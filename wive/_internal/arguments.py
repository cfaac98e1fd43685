"""Checks on what users pass. Every error is one line: the argument, what was expected, what came."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal.arrays import NUMPY, library_of
from wive._internal.precision import FLOAT32, Floats, Real
from wive._internal.room import expect_room
from wive._internal.scalars import choice as choice
from wive._internal.scalars import flag as flag
from wive._internal.scalars import integer as integer
from wive._internal.scalars import real as real
from wive._internal.scalars import unreadable

Int32 = NDArray[np.int32]


def vector(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """`value` as a finite float64 vector (3,)."""
    array = numeric(name, value, "three real numbers", "fiu")
    if array.shape != (3,):
        raise ValueError(f"{name} must be three real numbers, got an array of shape {array.shape}")
    numbers = _doubles(array)
    if not np.isfinite(numbers).all():
        raise ValueError(f"{name} must be finite, got {numbers.tolist()}")
    return numbers


def bounds(value: ArrayLike, largest: float) -> NDArray[np.float64]:
    """The lowest and the highest corner of a box, (2,3) float64."""
    array = numeric("bounds", value, "a (2, 3) array of real numbers", "fiu")
    if array.shape != (2, 3):
        raise ValueError(
            f"bounds must have shape (2, 3), the lowest and the highest corner, got {array.shape}"
        )
    corners = _doubles(array)
    if not np.isfinite(corners).all():
        raise ValueError("bounds must be finite to be framed: the mesh has no triangle that can be hit")
    if (corners[0] > corners[1]).any():
        raise ValueError(f"bounds must be the lowest and then the highest corner, got {corners.tolist()}")
    if np.max(abs(corners)) > largest:
        raise ValueError(f"bounds must be at most {largest:.3g} in magnitude, got {corners.tolist()}")
    return corners


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A view of the array that can't be written to."""
    view = array.view(np.ndarray)
    view.flags.writeable = False
    return view


def rays(
    origins: ArrayLike, directions: ArrayLike, tmin: ArrayLike, tmax: ArrayLike, real: Real = FLOAT32
) -> tuple[Floats, Floats, Floats, Floats]:
    """Origins and directions (n,3), tmin and tmax (1,) or (n,), all C-contiguous and of `real`'s dtype.

    A vector of shape (3,) is shared by all rays.
    """
    dtype = real.dtype
    origin_rows = origins if _is_ready(origins, dtype) else vectors("origins", origins, real)
    direction_rows = directions if _is_ready(directions, dtype) else vectors("directions", directions, real)
    if origin_rows.ndim == direction_rows.ndim == 1:
        origin_rows, direction_rows = origin_rows[None], direction_rows[None]
    elif origin_rows.ndim == 1:
        origin_rows = _repeated(origin_rows, len(direction_rows))
    elif direction_rows.ndim == 1:
        direction_rows = _repeated(direction_rows, len(origin_rows))
    count = len(origin_rows)
    if len(direction_rows) != count:
        raise ValueError(
            f"origins and directions must be equally many, got {count} and {len(direction_rows)}"
        )
    common = real.limits  # looked up here: a query of one ray spends most of its time in calls
    low = common[tmin] if type(tmin) is float and tmin in common else limits("tmin", tmin, count, real)
    high = common[tmax] if type(tmax) is float and tmax in common else limits("tmax", tmax, count, real)
    return origin_rows, direction_rows, low, high


def directions(value: ArrayLike, count: int, real: Real = FLOAT32) -> Floats:
    """The directions of `count` rays, (count,3) of `real`'s dtype, C-contiguous unless all rays share one."""
    return per_hit("directions", value, 3, count, real)


def per_hit(name: str, value: ArrayLike, columns: int, count: int, real: Real) -> Floats:
    """A vector of so many numbers per hit or triangle, (count,columns), C-contiguous unless all share one."""
    if columns == 3 and _is_ready(value, real.dtype):
        rows: Floats = value
    else:
        rows = vectors(name, value, real, columns=columns)
    if rows.ndim == 1:
        return np.broadcast_to(rows, (count, columns))
    if len(rows) != count:
        raise ValueError(
            f"{name} must have shape ({count}, {columns}), one per hit, or ({columns},), got {rows.shape}"
        )
    return rows


def vectors(name: str, value: ArrayLike, real: Real, may_be_one: bool = True, columns: int = 3) -> Floats:
    """Vectors (n,3), or one (3,) that all rays share if it `may_be_one`, of `real`'s dtype, C-contiguous.

    `columns` is how many numbers a vector has, if not three.
    """
    array = numeric(name, value, f"an (n, {columns}) array of real numbers", "fiu", masked=True)
    if array.shape == (0,):
        return real.array(array.reshape(0, columns))
    if array.ndim not in (1 if may_be_one else 2, 2) or array.shape[-1] != columns:
        one = f", or ({columns},) if all rays share it" if may_be_one else ""
        raise ValueError(f"{name} must have shape (n, {columns}){one}, got {array.shape}")
    return _missing_if_masked(value, array, real)


def limits(name: str, value: ArrayLike, count: int, real: Real = FLOAT32, whose: str = "ray") -> Floats:
    """The limits of `count` rays or points, (1,) or (count,) of `real`'s dtype."""
    array = numeric(name, value, f"a real number or one per {whose}", "fiu", masked=True)
    if array.shape not in ((), (count,)):
        raise ValueError(
            f"{name} must be one number or have shape ({count},), one per {whose}, got shape {array.shape}"
        )
    return _missing_if_masked(value, array, real).reshape(-1)


def array_of_numbers(name: str, value: ArrayLike) -> NDArray[Any]:
    """`value` as an array of real numbers of any shape; a masked one if some are masked."""
    array, mask = numeric(name, value, "an array of real numbers", "fiu", masked=True), _mask(value)
    return array if mask is None else np.ma.MaskedArray(array, mask)


def nan_if_masked(array: NDArray[Any]) -> NDArray[Any]:
    """The array's numbers, NaN if masked."""
    if type(array) is np.ndarray:
        return array
    return np.where(np.ma.getmaskarray(array), np.nan, array.data)


def _is_ready(value: ArrayLike, dtype: np.dtype[Any]) -> TypeGuard[Floats]:
    """Whether `value` is an (n,3) array as the core takes it; quick, as checks are most of a small query."""
    return (
        type(value) is np.ndarray
        and value.dtype is dtype
        and value.ndim == 2
        and value.shape[1] == 3
        and (flags := value.flags).c_contiguous
        and flags.aligned
    )


def _doubles(array: NDArray[Any]) -> NDArray[np.float64]:
    """The numbers as float64, in which those of longdouble may be infinite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return array.astype(np.float64)


def _repeated(vector: Floats, count: int) -> Floats:
    expect_room(count * len(vector), vector.dtype)
    return np.tile(vector, (count, 1))


def numeric(
    name: str,
    value: ArrayLike,
    expected: str,
    kinds: Sequence[str],
    mend: str = "convert it first",
    masked: bool = False,
) -> NDArray[Any]:
    """`value` as an array of these kinds of dtype; ValueError if some are masked and may not be `masked`."""
    try:
        array = _as_numpy(value)
    except MemoryError:
        raise
    except Exception as error:  # of `__array__`, which raises anything
        if isinstance(value, (list, tuple)) and isinstance(error, ValueError):
            raise ValueError(f"{name} must be {expected}, got rows of unequal length") from None
        raise unreadable(name, value, error) from None
    if array.dtype.kind not in kinds and array.shape != (0,):
        is_no_array = array.dtype == object and array.ndim == 0
        got = type(value).__name__ if is_no_array else f"dtype {array.dtype}"
        raise TypeError(f"{name} must be {expected}, got {got}: {mend}")
    if not masked and (mask := _mask(value)) is not None:
        raise ValueError(
            f"{name} must be {expected}, got {np.count_nonzero(mask)} that are masked: "
            "fill or remove them first"
        )
    return array


def _as_numpy(value: ArrayLike) -> NDArray[Any]:
    """NumPy's array of the same numbers; of arrays in host memory as their library gives it."""
    library = library_of(value)
    if library is not NUMPY and library.device(value) == "cpu":
        return np.asarray(library.to_numpy(value))  # of a tensor with a gradient, its numbers
    return np.asarray(value)


def _missing_if_masked(value: ArrayLike, array: NDArray[Any], real: Real) -> Floats:
    """The array's numbers in `real`'s dtype, NaN if masked: such a ray misses."""
    mask = _mask(value)
    if mask is None:
        return real.array(array)
    shown = np.where(mask, array.dtype.type(0), array)
    numbers = real.array(shown).copy()
    numbers[mask] = np.nan
    return numbers


def _mask(value: ArrayLike) -> NDArray[np.bool_] | None:
    """Which numbers of a masked array, or of a list of such, are masked; None if there is none."""
    ma = sys.modules.get("numpy.ma")  # importing it takes time, and without it there are no masked arrays
    if ma is None or type(value) is np.ndarray:
        return None
    if isinstance(value, list | tuple) and any(isinstance(row, ma.MaskedArray) for row in value):
        value = ma.asarray(value)
    mask = ma.getmask(value)
    return ma.getmaskarray(value) if np.any(mask) else None
