"""NumPy's own files, read without trusting them: headers are checked before anything is allocated."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from wive._internal.archives import Archive
from wive._internal.files import PathLike, file_name
from wive._internal.lines import one_line
from wive._internal.npy_rows import MOST_HEADER, FileRows, Header, fill, npy_header


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

    def rows(self, key: str) -> FileRows:
        """The array `key`, to be read a piece at a time."""
        member = self._members[key]
        return FileRows(
            lambda: self._archive.open(member),
            lambda: _refused(self._name, self._expected, f"array `{key:.40}`"),
        )

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
def open_npy_or_npz(path: PathLike, expected: str) -> Iterator[FileRows | Npz]:
    """The rows of the array of an npy file, or the arrays of an npz file while the block runs."""
    name = check_input(path)
    with open(name, "rb") as file:
        magic = file.read(len(npy.MAGIC_PREFIX))
        file.seek(0)
        if magic != npy.MAGIC_PREFIX:
            yield Npz(file, name, expected)
            return
    rows = file_rows(name, expected)
    try:
        yield rows
    finally:
        rows.close()


def file_rows(name: str, expected: str, header: Callable[[bytes, int], Header] | None = None) -> FileRows:
    """The rows of the array of a file, whose `header` is that of npy if None."""

    def opened() -> tuple[IO[bytes], int]:
        stream = open(name, "rb", buffering=0)  # noqa: SIM115  # FileRows closes it
        return stream, os.fstat(stream.fileno()).st_size

    return FileRows(opened, lambda: _refused(one_line(name), expected, "its array"), header)


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
    shape, fortran, dtype, start = npy_header(head, size)
    array = np.empty(shape, dtype, order="F" if fortran else "C")
    flat = array.reshape(-1, order="A").view(np.uint8)
    flat[: len(head) - start] = np.frombuffer(head, np.uint8, offset=start)
    fill(stream, flat[len(head) - start :])
    stream.read(1)  # zipfile compares the checksum at the end
    return array
