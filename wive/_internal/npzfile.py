"""NumPy's own files, read without trusting them: headers are checked before anything is allocated."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from wive._internal.archives import Archive
from wive._internal.files import PathLike, file_name
from wive._internal.lines import one_line

# A header is some 100 bytes; NumPy refuses one over 10,000 of its own accord.
MOST_HEADER = 1 << 15
CHUNK = 1 << 20


class Npz(Mapping[str, NDArray[Any]]):
    """The arrays of an npz file by name, each unpacked when it is asked for.

    Raises ValueError, in one line that names the file and the array, if the file is damaged or an array holds
    Python objects, which only unpickling could read.
    """

    def __init__(self, file: IO[bytes], name: str, expected: str) -> None:
        """Read the table of contents; `expected` says in errors what the file should have been."""
        self._name, self._expected = one_line(name), expected
        with _refused(self._name, expected, "its table of contents"):
            self._archive = Archive(file)
        self._members = {member.removesuffix(".npy"): member for member in self._archive.names}

    def __getitem__(self, key: str) -> NDArray[Any]:
        """The array `key`."""
        member = self._members[key]
        with _refused(self._name, self._expected, f"array `{key:.40}`"):
            stream, size = self._archive.open(member)
            with stream:
                return _array(stream, size)

    def __contains__(self, key: object) -> bool:
        """Whether there is such an array; it is not unpacked for that."""
        return key in self._members

    def __iter__(self) -> Iterator[str]:
        """Names of arrays, in the file's order."""
        return iter(self._members)

    def listed(self) -> str:
        """The names of the arrays as errors list them."""
        return one_line(", ".join(sorted(self._members)))[:100] or "none"

    def __len__(self) -> int:
        """Number of arrays."""
        return len(self._members)


@contextmanager
def open_npz(path: PathLike, expected: str) -> Iterator[Npz]:
    """The arrays of an npz file, while the block runs; `expected` says in errors what the file should be."""
    name = check_input(path)
    with open(name, "rb") as file:
        yield Npz(file, name, expected)


@contextmanager
def open_npy_or_npz(path: PathLike, expected: str) -> Iterator[NDArray[Any] | Npz]:
    """The array of an npy file, or the arrays of an npz file while the block runs."""
    name = check_input(path)
    with open(name, "rb") as file:
        magic = file.read(len(npy.MAGIC_PREFIX))
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        if magic != npy.MAGIC_PREFIX:
            yield Npz(file, name, expected)
            return
        with _refused(one_line(name), expected, "its array"):
            array = _array(file, size)
        yield array


def check_input(path: PathLike) -> str:
    """Raise OSError unless `path` is a file that can be read; return it as text."""
    name = file_name(path)
    if not os.path.exists(name):
        raise FileNotFoundError(f"{one_line(name)}: no such file")
    if not os.path.isfile(name):
        raise OSError(f"{one_line(name)}: not a file")
    if not os.access(name, os.R_OK):
        raise PermissionError(f"{one_line(name)}: not readable")
    return name


@contextmanager
def _refused(name: str, expected: str, place: str) -> Iterator[None]:
    """Make one ValueError of whatever NumPy, zipfile and zlib raise on damaged bytes."""
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:
        reason = one_line(str(error) or type(error).__name__)
        raise ValueError(f"{name}: not {expected}, or damaged ({place}: {reason:.100})") from None


def _array(stream: IO[bytes], size: int) -> NDArray[Any]:
    """The array of an npy file of `size` bytes, in the memory order of the file."""
    head = stream.read(MOST_HEADER)
    shape, fortran, dtype, start = _header(head)
    if dtype.hasobject:
        raise ValueError(f"holds Python objects (dtype {dtype}), expected numbers")
    wanted = math.prod(shape) * dtype.itemsize
    if any(side < 0 for side in shape) or dtype.itemsize == 0 or wanted != size - start:
        raise ValueError(f"claims shape {shape} of {dtype}, holds {size - start} bytes")
    array = np.empty(shape, dtype, order="F" if fortran else "C")
    left = memoryview(array.reshape(-1, order="A").view(np.uint8))
    left[: len(head) - start] = head[start:]
    left = left[len(head) - start :]
    while left:
        count = stream.readinto(left[:CHUNK])  # type: ignore[attr-defined]  # of io.BufferedIOBase
        if not count:
            raise ValueError(f"cut off {len(left)} bytes before its end")
        left = left[count:]
    stream.read(1)  # zipfile compares the checksum at the end
    return array


def _header(head: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, whether in Fortran order, dtype and length of an npy header."""
    stream = io.BytesIO(head)
    version = npy.read_magic(stream)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    try:
        shape, fortran, dtype = read(stream)
    except MemoryError:  # Python's parser, of nested text; the header itself is short
        raise ValueError("its header is nested too deep") from None
    return shape, fortran, dtype, stream.tell()
