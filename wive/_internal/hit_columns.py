"""The arrays of hits as they are written: in place in an npz file, or in npy files."""

from __future__ import annotations

import errno
import os
import zlib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.npz_layout import NPY_HEAD, NpzLayout, Stored, joined_crc, npy_head

COPIED = 1 << 18
NPZ = "npz"  # the npz file in the making


class Column(NamedTuple):
    """An array that is written: a row per ray, or per hit if all hits are."""

    name: str
    dtype: np.dtype[Any]
    tail: tuple[int, ...] = ()

    @property
    def row(self) -> int:
        """Bytes of a row."""
        return int(np.prod(self.tail, dtype=np.int64)) * self.dtype.itemsize


class HitColumns:
    """The files of an output in the making: one npz file, or npy files that are to be a folder.

    The number of all hits is not known before the end. In an npz file of them, the offsets come first, and
    the largest array grows in its place behind them; others grow in files of their own and are copied at the
    end.
    """

    def __init__(self, columns: list[Column], count: int, *, ragged: bool, is_folder: bool) -> None:
        """Of `count` rays; columns have rows per hit if `ragged`, and "offsets" is added."""
        self._columns, self._count = columns, count
        self._ragged, self._is_folder = ragged, is_folder
        if ragged:
            largest = max(columns, key=lambda column: column.row)
            others = [column for column in columns if column is not largest]
            self._columns = [Column("offsets", np.dtype(np.int64)), largest, *others]
        # Arrays that are copied at the end.
        self._beside = {column.name for column in self._columns[2:]} if ragged and not is_folder else set()
        self._begins = {column.name: NPY_HEAD for column in self._columns}
        self._files: dict[str, int] = {}
        # Of the numbers alone, without the heads of npy files. A folder needs none.
        self.crcs: dict[str, int] = {} if is_folder else dict.fromkeys(self._begins, 0)
        if "offsets" in self.crcs:
            self.crcs["offsets"] = zlib.crc32(bytes(8))  # the first one

    @property
    def files(self) -> set[int]:
        """All open files."""
        return set(self._files.values())

    @property
    def outputs(self) -> set[int]:
        """Those that become the output."""
        return {file for name, file in self._files.items() if name not in self._beside}

    def open(self, folder: str) -> None:
        """Open the files, of their whole size if that is known."""
        os.makedirs(folder, exist_ok=True)
        arrays = self._stored(0 if self._ragged else self._count)
        if not self._is_folder:
            layout = NpzLayout(arrays)
            in_place = [array for array in arrays if array.name not in self._beside]
            self._begins |= {array.name: layout.begins[array.name] + NPY_HEAD for array in in_place}
            end = self._begins[in_place[-1].name] - NPY_HEAD + in_place[-1].size
            shared = _opened(os.path.join(folder, NPZ), end)
            self._files = {array.name: shared for array in in_place}
        for array in arrays:
            if array.name not in self._files:
                size = 0 if self._ragged else array.size
                self._files[array.name] = _opened(os.path.join(folder, f"{array.name}.npy"), size)
        if self._ragged:
            _write_at(self._files["offsets"], memoryview(bytes(8)), self._begins["offsets"])

    def write(self, arrays: dict[str, NDArray[Any]], done: int, rows: int) -> tuple[dict[str, int], int]:
        """Write arrays behind `done` rays and `rows` rows; the checksums then, and bytes of the output."""
        crcs, written = dict(self.crcs), 0
        for column in self._columns:
            array, row = arrays[column.name], rows
            if column.name == "offsets":
                array, row = array[1:] + rows, done + 1
            data = np.ascontiguousarray(array, column.dtype).reshape(-1).view(np.uint8)
            place = self._begins[column.name] + row * column.row
            _write_at(self._files[column.name], memoryview(data), place)
            if crcs:
                crcs[column.name] = _cpu.crc32(data, crcs[column.name])
            if column.name not in self._beside:
                written += len(data)
        return crcs, written

    def end_folder(self, rows: int) -> None:
        """Write the heads of npy files of so many rows, cut the files to their sizes and flush them."""
        for array in self._stored(rows):
            file = self._files[array.name]
            _write_at(file, memoryview(npy_head(array.dtype, array.shape)), 0)
            os.ftruncate(file, array.size)
            os.fsync(file)

    def end_npz(self, rows: int, comment: bytes, copied: Callable[[int], None]) -> None:
        """Make an npz file of so many rows, with a comment; `copied` is told bytes as they are copied."""
        layout = NpzLayout(self._stored(rows))
        made, crcs = next(iter(self.outputs)), {}
        for array in layout.arrays:
            head = npy_head(array.dtype, array.shape)
            begin = layout.begins[array.name]
            _write_at(made, memoryview(head), begin)
            if array.name in self._beside:
                self._copy(array.name, made, begin + NPY_HEAD, array.size - NPY_HEAD, copied)
            crcs[array.name] = joined_crc(zlib.crc32(head), self.crcs[array.name], array.size - NPY_HEAD)
        for place, head in layout.heads(crcs):
            _write_at(made, memoryview(head), place)
        tail = layout.tail(crcs, comment)
        _write_at(made, memoryview(tail), layout.end)
        os.ftruncate(made, layout.end + len(tail))

    def close(self) -> None:
        """Close the files."""
        files, self._files = self.files, {}
        for file in files:
            os.close(file)

    def _copy(self, name: str, made: int, place: int, left: int, copied: Callable[[int], None]) -> None:
        """Copy an array that grew beside the npz file to its place there."""
        buffer = memoryview(bytearray(COPIED))
        with open(self._files[name], "rb", buffering=0, closefd=False) as file:
            file.seek(self._begins[name])
            while left:
                count = file.readinto(buffer[:left])
                if not count:
                    raise OSError(errno.EIO, f"array {name} was cut off by another program")
                _write_at(made, buffer[:count], place)
                place, left = place + count, left - count
                copied(count)

    def _stored(self, rows: int) -> list[Stored]:
        return [
            Stored(
                column.name,
                column.dtype,
                (self._count + 1 if column.name == "offsets" else rows, *column.tail),
            )
            for column in self._columns
        ]


def _opened(name: str, size: int) -> int:
    file = os.open(name, os.O_RDWR | os.O_CREAT, 0o666)
    if size > 0 and hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(file, 0, size)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS):
                os.close(file)
                raise
    return file


def _write_at(file: int, data: memoryview, place: int) -> None:
    while len(data):
        count = os.pwrite(file, data, place)
        data, place = data[count:], place + count
