"""Rays of a file or of arrays, read in order, a piece at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive import _cpu
from wive._internal.arguments import nan_if_masked
from wive._internal.arguments import rays as checked_rays
from wive._internal.files import PathLike
from wive._internal.lines import one_line
from wive._internal.npy_rows import ArrayRows, FileRows, Header, Rows
from wive._internal.npzfile import Npz, check_input, file_rows, open_npy_or_npz
from wive._internal.precision import FLOAT64

EXPECTED = "a file of rays, (n,6) or (n,8) in an .npy or `origins` and `directions` in an .npz"
NAMES = ("ox", "oy", "oz", "dx", "dy", "dz", "tmin", "tmax")
SKIPPED = "_"

Array = NDArray[Any]
Rays = tuple[Any, Any, Any, Any]  # origins, directions, tmin, tmax
LIMITS = 0.0, np.inf
RaySource = PathLike | ArrayLike | Sequence[ArrayLike]
Taken = Callable[[int, "list[RunningChecksum]"], Rays]


class Raw(NamedTuple):
    """What a file without a header holds: numbers of a dtype, so many columns per ray."""

    dtype: np.dtype[Any]
    columns: tuple[str, ...] = NAMES[:6]

    def header(self, head: bytes, size: int) -> Header:
        """As of an npy file; ValueError if the file does not hold whole rows."""
        row = self.dtype.itemsize * len(self.columns)
        if size % row:
            raise ValueError(f"holds {size} bytes, no multiple of {row}, {len(self.columns)} of {self.dtype}")
        return (size // row, len(self.columns)), False, self.dtype, 0


def raw_format(dtype: DTypeLike, columns: str | Sequence[str] | None = None) -> Raw:
    """The format, checked; columns are names, or a text of names with commas between."""
    try:
        found = np.dtype(dtype)
    except (TypeError, ValueError):
        found = np.dtype(object)
    if found.kind not in "fiu":
        raise ValueError(
            f"dtype of raw rays must be one of real numbers, such as float32 or >f8, got {dtype!s:.40}"
        )
    if columns is None:
        return Raw(found)
    names = tuple(columns.split(",") if isinstance(columns, str) else columns)
    known = [name for name in names if name != SKIPPED]
    if len(set(known)) != len(known) or not set(NAMES[:6]) <= set(known) <= set(NAMES):
        raise ValueError(
            f"columns of raw rays must be each of {', '.join(NAMES[:6])}, maybe tmin, tmax, and {SKIPPED} "
            f"for what is to be skipped, got {one_line(','.join(map(str, names))):.80}"
        )
    return Raw(found, names)


class RayReader:
    """Rays, read in order; there are `count`."""

    def __init__(self, count: int, sources: list[Rows], taken: Taken, kind: str) -> None:
        """`taken` reads so many rays of the sources; `kind` says of what dtypes and shapes these are."""
        self.count, self.kind = count, kind
        self._checksums = [RunningChecksum() for _ in sources]
        self._sources, self._taken = sources, taken

    def read(self, count: int, checksummed: bool = False) -> Rays:
        """The next rays. They count in `checksum` if all before did."""
        return self._taken(count, self._checksums if checksummed else [])

    def skip(self, count: int) -> None:
        """Leave the next rays out."""
        for source in self._sources:
            source.skip(min(count, self.count))

    @property
    def checksum(self) -> list[str]:
        """Of all rays read, of each array."""
        return [checksum.text for checksum in self._checksums]


class RunningChecksum:
    """A checksum of bytes that doesn't depend on the pieces they are added in."""

    def __init__(self) -> None:
        """Of nothing."""
        self.core = _cpu.RunningChecksum()

    def add(self, array: Array) -> None:
        """Add the array's bytes."""
        self.core.add(np.ascontiguousarray(array).reshape(-1).view(np.uint8))

    @property
    def text(self) -> str:
        """The checksum."""
        blocks, rest = self.core.both
        return f"{blocks:016x}{rest:016x}"


@contextmanager
def open_rays(source: RaySource, raw: Raw | None = None) -> Iterator[RayReader]:
    """Rays of a file, or of arrays: (n,6), (n,8), or (origins, directions, tmin, tmax), while the block runs.

    Raises OSError, TypeError, or ValueError in one line that names the file, or the argument if it is none.
    """
    if not isinstance(source, str | bytes | os.PathLike):
        if raw is not None:
            raise ValueError("raw is only for files of rays, got arrays: leave it out")
        yield _of_arrays(source)
        return
    name = one_line(check_input(source))
    if raw is not None:
        rows = file_rows(check_input(source), "a file of raw rays", raw.header)
        try:
            yield _of_table(rows, raw.columns)
        finally:
            rows.close()
        return
    with open_npy_or_npz(source, EXPECTED) as loaded:
        if not isinstance(loaded, Npz):
            if len(loaded.shape) != 2 or loaded.shape[1] not in (6, 8):
                raise ValueError(f"{name}: not {EXPECTED}: found shape {loaded.shape}")
            with _named(name):
                reader = _of_table(loaded, NAMES[: loaded.shape[1]])
            yield reader
            return
        if not {"origins", "directions"} <= loaded.keys():
            raise ValueError(f"{name}: not {EXPECTED}: found arrays {loaded.listed()}")
        given: list[Rows | Any] = []
        try:
            for key, default in zip(
                ("origins", "directions", "tmin", "tmax"), (None, None, *LIMITS), strict=True
            ):
                if key not in loaded:
                    given.append(default)
                    continue
                rows = loaded.rows(key)
                is_common = len(rows.shape) == 0 or (key in ("origins", "directions") and rows.shape == (3,))
                given.append(loaded[key] if is_common else rows)
            with _named(name):
                reader = _of_parts(given)
            yield reader
        finally:
            for part in given:
                if isinstance(part, Rows):
                    part.close()


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Name the file in errors about its arrays."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error


def _of_arrays(source: Any) -> RayReader:
    if isinstance(source, tuple) and 2 <= len(source) <= 4:
        given = [*source, *LIMITS[len(source) - 2 :]]
        arrays = [_array(value) for value in given]
        parts: list[Rows | Any] = [
            array if array.ndim == 0 or (i < 2 and array.shape == (3,)) else ArrayRows(array)
            for i, array in enumerate(arrays)
        ]
        return _of_parts(parts)
    table = _array(source)
    if table.ndim != 2 or table.shape[1] not in (6, 8):
        raise ValueError(
            "rays must be a file name, an array (n,6) or (n,8), or a tuple (origins, directions) and maybe "
            f"tmin, tmax, got shape {table.shape}"
        )
    return _of_table(ArrayRows(table), NAMES[: table.shape[1]])


def _array(value: Any) -> Array:
    """The value as an array, mapped files as they are, NaN for masked numbers."""
    array = value if isinstance(value, np.ndarray) else np.asarray(value)
    return nan_if_masked(array) if isinstance(array, np.ma.MaskedArray) else array


def _of_table(rows: Rows, names: Sequence[str]) -> RayReader:
    """Rays whose numbers are columns of one array."""
    places = {name: i for i, name in enumerate(names)}
    vectors = [[places[name] for name in NAMES[:3]], [places[name] for name in NAMES[3:6]]]
    dtype = rows.dtype.newbyteorder("=")
    step = max(1, _cpu.RunningChecksum.block_bytes // (rows.dtype.itemsize * len(names)))
    is_usual = tuple(names[:6]) == NAMES[:6] and dtype in (np.float32, np.float64)
    is_plain = is_usual and tuple(names) in (NAMES[:6], NAMES) and rows.dtype == dtype

    def taken(count: int, checksums: list[RunningChecksum]) -> Rays:
        split = [np.empty((count, 3), dtype) for _ in vectors]
        limits = [np.empty(count, dtype) if name in places else None for name in NAMES[6:]]
        low, high = (usual if limit is None else limit for limit, usual in zip(limits, LIMITS, strict=True))
        if is_plain and isinstance(rows, FileRows):
            core = checksums[0].core if checksums else None
            arrays = split[0], split[1], limits[0], limits[1]
            if rows.read_by(count, lambda file, place: _cpu.read_rays(file, place, *arrays, core)):
                return split[0], split[1], low, high
        for begin in range(0, count, step):
            table = rows.read(min(step, count - begin))
            for checksum in checksums:
                checksum.add(table)
            place = slice(begin, begin + len(table))
            if is_usual:
                _cpu.split_rays(np.ascontiguousarray(table, dtype), split[0][place], split[1][place])
            else:
                for whole, columns in zip(split, vectors, strict=True):
                    for axis, column in enumerate(columns):  # numbers one by one: NumPy is slow on short rows
                        whole[place, axis] = table[:, column]
            for limit, name in zip(limits, NAMES[6:], strict=True):
                if limit is not None:
                    limit[place] = table[:, places[name]]
        return split[0], split[1], low, high

    checked_rays(*taken(0, []), FLOAT64)
    return RayReader(rows.shape[0], [rows], taken, f"{rows.dtype.str} {','.join(names)}")


def _of_parts(parts: list[Rows | Any]) -> RayReader:
    """Origins, directions, tmin and tmax, each an array of its own, or the same for all rays."""
    sources = [part for part in parts if isinstance(part, Rows)]
    counts = [part.shape[0] for part in parts[:2] if isinstance(part, Rows)]
    count = max(counts, default=1)

    def joined(blocks: list[Array]) -> Rays:
        left = iter(blocks)
        origins, directions, low, high = (next(left) if isinstance(part, Rows) else part for part in parts)
        return origins, directions, low, high

    def taken(count: int, checksums: list[RunningChecksum]) -> Rays:
        blocks = [source.read(count) for source in sources]
        for checksum, block in zip(checksums, blocks, strict=False):
            checksum.add(block)
        return joined(blocks)

    # What is wrong with dtypes and shapes is wrong with no row as well.
    checked_rays(*joined([np.empty((0, *source.shape[1:]), source.dtype) for source in sources]), FLOAT64)
    if any(len(source.shape) > 0 and source.shape[0] != count for source in sources):
        if len(set(counts)) > 1:
            raise ValueError(f"origins and directions must be equally many, got {counts[0]} and {counts[1]}")
        name, shape = next(
            (name, part.shape)
            for name, part in zip(("tmin", "tmax"), parts[2:], strict=True)
            if isinstance(part, Rows) and part.shape[0] != count
        )
        raise ValueError(
            f"{name} must be one number or have shape ({count},), one per ray, got shape {shape}"
        )
    kinds = [
        f"{part.dtype.str}{part.shape[1:]}" if isinstance(part, Rows) else str(np.asarray(part).tolist())
        for part in parts
    ]
    return RayReader(count, sources, taken, " ".join(kinds))
