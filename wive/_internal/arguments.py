"""Checks on what users pass. Every error is one line: the argument, what was expected, what came."""

from __future__ import annotations

import functools
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypedDict, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive._internal.precision import FLOAT32, Floats, Real, real_asked, real_of
from wive._internal.progress import ProgressOption
from wive._internal.room import expect_room
from wive._internal.scalars import MOST_COUNT, shown, unreadable
from wive._internal.scalars import choice as choice
from wive._internal.scalars import flag as flag
from wive._internal.scalars import integer as integer
from wive._internal.scalars import real as real

Given = ArrayLike  # what users pass, by a name short enough for overloads
Int32 = NDArray[np.int32]
AccuracyOption = Literal["fast", "watertight", "exact"]
NodesOption = Literal["float32", "compressed"]
QualityOption = Literal["medium", "high"]
Lanes = Literal[1, 8]
LanesOption = Literal["auto", 8, 1]

# The options that not every backend has, and which backends have them.
HAVE_OPTION = {"threads": "CPU backends", "in_flight": "CPU backends", "lanes": "backend 'warp'"}
# More threads than this only cost memory.
MOST_THREADS = 4096
MOST_BYTES = 2**63 - 1


class QueryOptions(TypedDict, total=False):
    """The options of a query as users give them."""

    threads: int | None
    in_flight: int | None
    lanes: LanesOption
    progress: ProgressOption


class Plain(QueryOptions, total=False):
    """The options of a query that returns no counters."""

    stats: Literal[False]


class Counted(QueryOptions):
    """The options of a query that returns counters."""

    stats: Literal[True]


class PlainCount(Plain, total=False):
    """The options of `count` without counters."""

    touching: bool


class CountedCount(Counted, total=False):
    """The options of `count` with counters."""

    touching: bool


class PlainAll(PlainCount, total=False):
    """The options of `intersect_all` without counters."""

    max_bytes: int | None


class CountedAll(CountedCount, total=False):
    """The options of `intersect_all` with counters."""

    max_bytes: int | None


class Work(NamedTuple):
    """The options of a query, checked."""

    threads: int = 0  # 0 is every core
    in_flight: int = 0  # 0 leaves it to the core
    stats: bool = False
    lanes: Lanes | None = None  # None leaves it to the Warp backend
    touching: bool = False  # of several hits: every triangle touched, not every crossing
    max_bytes: int = 0  # of all hits; 0 is by what memory there is


# `Work` of a tuple, in a third of the time that `Work(...)` takes.
_work = functools.partial(tuple.__new__, Work)
# If no option is given: made once, because making it takes a tenth of the time of a one-ray query.
USUAL_WORK = Work()


def vector(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """`value` as a finite float64 vector (3,)."""
    array = _numeric(name, value, "three real numbers", "fiu")
    if array.shape != (3,):
        raise ValueError(f"{name} must be three real numbers, got an array of shape {array.shape}")
    numbers = _doubles(array)
    if not np.isfinite(numbers).all():
        raise ValueError(f"{name} must be finite, got {numbers.tolist()}")
    return numbers


def bounds(value: ArrayLike, largest: float) -> NDArray[np.float64]:
    """The lowest and the highest corner of a box, (2,3) float64."""
    array = _numeric("bounds", value, "a (2, 3) array of real numbers", "fiu")
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
    corners = _numeric("faces", faces, "an (f, 3) array of integers", "iu", "round them to integer indices")
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
    rows = _numeric(name, value, f"an {shapes} array of integers", "iu", "round them to integer indices")
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


def triangles(name: str, value: ArrayLike, count: int) -> Int32:
    """Rows (n,) of `count` faces, or -1 for none."""
    array = _numeric(name, value, "an (n,) array of integers", "iu", "round them to integer indices")
    if array.ndim != 1:
        raise ValueError(f"{name} must have shape (n,), one triangle per ray, got {array.shape}")
    if array.size and (array.min() < -1 or array.max() >= count):
        row = int(np.argmax((array < -1) | (array >= count)))
        raise ValueError(
            f"{name} must be rows of the {count} faces from 0, or -1 for none, "
            f"got {name}[{row}] = {array[row]}"
        )
    return array.astype(np.int32, copy=False)


def threads(value: int | None) -> int:
    """The number of threads to use; 0 is one per core that this process may run on."""
    if value is None:
        return 0
    return min(integer("threads", value, 1), MOST_THREADS)


def in_flight(value: int | None) -> int:
    """Rays interleaved per thread; 0 lets the core choose."""
    return 0 if value is None else integer("in_flight", value, 1)


def max_bytes(value: int | None) -> int:
    """The bytes that all hits may take; 0 is by what memory there is."""
    return 0 if value is None else integer("max_bytes", value, 1, MOST_BYTES)


def work(
    backend: str,
    lacks: Iterable[str],
    asked_threads: int | None,
    asked_in_flight: int | None,
    asked_lanes: LanesOption,
    stats: bool,
    touching: bool = False,
    most_bytes: int | None = None,
) -> Work:
    """The options of a query, checked; ValueError for one that the backend lacks."""
    chosen = lanes(asked_lanes)
    flags = flag("stats", stats), chosen, flag("touching", touching), max_bytes(most_bytes)
    checked = _work((threads(asked_threads), in_flight(asked_in_flight), *flags))
    refuse_lacking(backend, lacks, {"threads": asked_threads, "in_flight": asked_in_flight, "lanes": chosen})
    return checked


def refuse_lacking(backend: str, lacks: Iterable[str], given: Mapping[str, object]) -> None:
    """Raise ValueError for an option that is given (not None) and that the backend lacks."""
    for name in lacks:
        value = given.get(name)
        if value is not None:
            raise ValueError(
                f"{name} is only for {HAVE_OPTION[name]}, got {value!r} with backend {backend!r}: "
                "leave it out"
            )


def lanes(value: object) -> Lanes | None:
    """8 or 1 lanes of a node per thread; None is "auto"."""
    if (
        not isinstance(value, (str, int, np.integer))
        or isinstance(value, bool)
        or value not in ("auto", 8, 1)
    ):
        raise ValueError(f"lanes must be one of auto, 8, 1, got {shown(value)}")
    if value == "auto":
        return None
    return 8 if value == 8 else 1


def vectors(name: str, value: ArrayLike, real: Real, may_be_one: bool = True, columns: int = 3) -> Floats:
    """Vectors (n,3), or one (3,) that all rays share if it `may_be_one`, of `real`'s dtype, C-contiguous.

    `columns` is how many numbers a vector has, if not three.
    """
    array = _numeric(name, value, f"an (n, {columns}) array of real numbers", "fiu", masked=True)
    if array.shape == (0,):
        return real.array(array.reshape(0, columns))
    if array.ndim not in (1 if may_be_one else 2, 2) or array.shape[-1] != columns:
        one = f", or ({columns},) if all rays share it" if may_be_one else ""
        raise ValueError(f"{name} must have shape (n, {columns}){one}, got {array.shape}")
    return _missing_if_masked(value, array, real)


def limits(name: str, value: ArrayLike, count: int, real: Real = FLOAT32, whose: str = "ray") -> Floats:
    """The limits of `count` rays or points, (1,) or (count,) of `real`'s dtype."""
    array = _numeric(name, value, f"a real number or one per {whose}", "fiu", masked=True)
    if array.shape not in ((), (count,)):
        raise ValueError(
            f"{name} must be one number or have shape ({count},), one per {whose}, got shape {array.shape}"
        )
    return _missing_if_masked(value, array, real).reshape(-1)


def array_of_numbers(name: str, value: ArrayLike) -> NDArray[Any]:
    """`value` as an array of real numbers of any shape; a masked one if some are masked."""
    array, mask = _numeric(name, value, "an array of real numbers", "fiu", masked=True), _mask(value)
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


def _positions(vertices: ArrayLike) -> NDArray[Any]:
    points = _numeric("vertices", vertices, "a (v, 3) array of real numbers", "fiu")
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


def _doubles(array: NDArray[Any]) -> NDArray[np.float64]:
    """The numbers as float64, in which those of longdouble may be infinite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return array.astype(np.float64)


def _repeated(vector: Floats, count: int) -> Floats:
    expect_room(count * len(vector), vector.dtype)
    return np.tile(vector, (count, 1))


def _numeric(
    name: str,
    value: ArrayLike,
    expected: str,
    kinds: Sequence[str],
    mend: str = "convert it first",
    masked: bool = False,
) -> NDArray[Any]:
    """`value` as an array of these kinds of dtype; ValueError if some are masked and may not be `masked`."""
    try:
        array = np.asarray(value)
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
