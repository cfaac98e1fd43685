"""Arrays whose rows are read in order, a piece at a time: of NumPy's files, of raw files and of memory."""

from __future__ import annotations

import io
import math
import mmap
import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import IO, Any, Protocol, runtime_checkable

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

# A header is some 100 bytes; NumPy refuses one over 10,000 of its own accord.
MOST_HEADER = 1 << 15
# Bytes that are read at once: few enough to be still in a cache when they are summed up.
CHUNK = 1 << 18


@runtime_checkable
class Rows(Protocol):
    """Rows of an array, each read once."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def read(self, count: int) -> NDArray[Any]:
        """The next `count` rows."""

    def skip(self, count: int) -> None:
        """Leave the next rows out."""

    def close(self) -> None:
        """Close the file."""


class FileRows:
    """Rows of the array of an npy file, or of a member of an npz file, in either memory order.

    Raises what `refused` makes of errors. No row is in memory but those that were read last.
    """

    def __init__(
        self,
        opened: Callable[[], tuple[IO[bytes], int]],
        refused: Callable[[], AbstractContextManager[None]],
        header: Callable[[bytes, int], Header] | None = None,
    ) -> None:
        """`opened` opens the file and tells its size; `header` tells what is in it, an npy header if None."""
        self._opened, self._refused = opened, refused
        self._streams: list[IO[bytes]] = []
        with refused():
            stream, size = opened()
            with stream:
                found = (header or npy_header)(stream.read(MOST_HEADER), size)
        self.shape, self._fortran, self.dtype, self._start = found
        self._left = self.shape[0] if self.shape else 0

    def read(self, count: int) -> NDArray[Any]:
        """The next `count` rows, C-contiguous, in the machine's byte order."""
        rows = np.empty((count, *self.shape[1:]), self.dtype)
        with self._refused():
            streams = self._streams or self._open()
            if len(streams) == 1:
                fill(streams[0], rows)
            else:
                column = np.empty(count, self.dtype)
                for i, stream in enumerate(streams):
                    fill(stream, column)
                    rows[:, i] = column
            self._left -= count
            if self._left == 0:
                streams[-1].read(1)  # zipfile compares the checksum at the end
        return rows.astype(self.dtype.newbyteorder("="), copy=False)

    def read_by(self, count: int, read: Callable[[int, int], int]) -> bool:
        """Leave the next rows to `read`: it takes an open file and a place, returns how many bytes it got.

        False, and nothing is read, unless rows lie together in a file of a system that reads at places.
        """
        with self._refused():
            streams = self._streams or self._open()
            file = streams[0]
            if len(streams) > 1 or not isinstance(file, io.FileIO) or not hasattr(os, "pread"):
                return False
            wanted = count * self.dtype.itemsize * math.prod(self.shape[1:])
            found = read(file.fileno(), file.tell())
            if found != wanted:
                raise ValueError(f"cut off {wanted - found} bytes before its end")
            file.seek(wanted, os.SEEK_CUR)
        self._left -= count
        return True

    def skip(self, count: int) -> None:
        """Leave the next rows out."""
        with self._refused():
            streams = self._streams or self._open()
            for stream in streams:
                stream.seek(
                    count * self.dtype.itemsize * math.prod(self.shape[1:]) // len(streams), os.SEEK_CUR
                )
        self._left -= count

    def close(self) -> None:
        """Close the file."""
        for stream in self._streams:
            stream.close()

    def _open(self) -> list[IO[bytes]]:
        """One stream, or one per column if a column's numbers lie together."""
        columns = self.shape[1] if self._fortran and len(self.shape) == 2 else 1
        for i in range(columns):
            stream, _ = self._opened()
            self._streams.append(stream)
            stream.seek(self._start + i * self.shape[0] * self.dtype.itemsize)
        return self._streams


class ArrayRows:
    """Rows of an array in memory. Pages of a mapped file are given back when they have been read."""

    def __init__(self, array: NDArray[Any]) -> None:
        """Begin with the first row."""
        self.shape, self.dtype = array.shape, array.dtype
        self._array, self._next = array, 0
        self._before = slice(0, 0)
        memory = getattr(array, "_mmap", None)
        can_drop = isinstance(memory, mmap.mmap) and not array.flags.writeable and array.flags.c_contiguous
        self._memory = memory if can_drop and hasattr(mmap, "MADV_DONTNEED") else None

    def read(self, count: int) -> NDArray[Any]:
        """The next `count` rows, not copied."""
        self._drop()
        self._before = slice(self._next, self._next + count)
        self._next += count
        return np.asarray(self._array[self._before])

    def skip(self, count: int) -> None:
        """Leave the next rows out."""
        self._next += count

    def close(self) -> None:
        """Give the last pages back."""
        self._drop()

    def _drop(self) -> None:
        """Give pages of the rows before back; who still uses them reads them again from the file."""
        rows = self._array[self._before]
        if self._memory is None or rows.size == 0:
            return
        begin = rows.ctypes.data - np.frombuffer(self._memory, np.uint8).ctypes.data
        first = -(-begin // mmap.PAGESIZE) * mmap.PAGESIZE
        if begin + rows.nbytes > first:
            self._memory.madvise(mmap.MADV_DONTNEED, first, begin + rows.nbytes - first)


Header = tuple[tuple[int, ...], bool, np.dtype[Any], int]


def npy_header(head: bytes, size: int) -> Header:
    """Shape, whether in Fortran order, dtype and length of the header of an npy file of `size` bytes.

    ValueError if the array can't be in the file.
    """
    stream = io.BytesIO(head)
    version = npy.read_magic(stream)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    try:
        shape, fortran, dtype = read(stream)
    except MemoryError:  # Python's parser, of nested text; the header itself is short
        raise ValueError("its header is nested too deep") from None
    start = stream.tell()
    if dtype.hasobject:
        raise ValueError(f"holds Python objects (dtype {dtype}), expected numbers")
    wanted = math.prod(shape) * dtype.itemsize
    if any(side < 0 for side in shape) or dtype.itemsize == 0 or wanted != size - start:
        raise ValueError(f"claims shape {shape} of {dtype}, holds {size - start} bytes")
    return shape, fortran, dtype, start


def fill(stream: IO[bytes], array: NDArray[Any]) -> None:
    """Read the C-contiguous array from the stream; ValueError if that ends before."""
    left = memoryview(array.reshape(-1).view(np.uint8))
    while left:
        count = stream.readinto(left[:CHUNK])  # type: ignore[attr-defined]  # of io.BufferedIOBase
        if not count:
            raise ValueError(f"cut off {len(left)} bytes before its end")
        left = left[count:]
