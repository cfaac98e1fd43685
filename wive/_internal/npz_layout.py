"""The layout of npz files whose arrays are written in place, and of npy files that grow."""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

import numpy as np

# Bytes of an npy file before its numbers: room for any shape that has two axes.
NPY_HEAD = 128
# Zip's records, of PKWARE's APPNOTE.TXT 4.3.7, 4.3.12, 4.3.14, 4.3.15 and 4.3.16, with 64-bit sizes (4.5.3).
LOCAL = struct.Struct("<4s5H3I2H")
LOCAL_EXTRA = struct.Struct("<2H2Q")
CENTRAL = struct.Struct("<4s6H3I5H2I")
CENTRAL_EXTRA = struct.Struct("<2H3Q")
END_64 = struct.Struct("<4sQ2H2I4Q")
LOCATOR_64 = struct.Struct("<4sIQI")
END = struct.Struct("<4s4H2IH")
VERSION, UNIX = 45, 3 << 8
FIRST_DAY = 1 << 5 | 1  # of 1980, as np.savez has it
IN_EXTRA, MANY = 0xFFFFFFFF, 0xFFFF
MODE = 0o600 << 16
# Zip's polynomial without its leading term, and 1: the highest power of x in the lowest bit.
POLYNOMIAL, ONE = 0xEDB88320, 1 << 31


class Stored(NamedTuple):
    """An array of an npz file."""

    name: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]

    @property
    def member(self) -> bytes:
        """The name of the npy file."""
        return f"{self.name}.npy".encode()

    @property
    def size(self) -> int:
        """Bytes of the npy file."""
        return NPY_HEAD + math.prod(self.shape) * self.dtype.itemsize


def npy_head(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """The beginning of an npy file, of the same length for every shape."""
    text = f"{{'descr': {dtype.str!r}, 'fortran_order': False, 'shape': {shape!r}, }}"
    head = b"\x93NUMPY\x01\x00" + struct.pack("<H", NPY_HEAD - 10)
    return head + text.encode().ljust(NPY_HEAD - len(head) - 1) + b"\n"


def joined_crc(first: int, second: int, length: int) -> int:
    """The CRC-32 of data and `length` bytes behind it, of their CRCs: first * x^(8 length) + second."""
    power, square = first, ONE >> 8
    while length:
        if length & 1:
            power = _product(power, square)
        square, length = _product(square, square), length >> 1
    return power ^ second


def _product(one: int, other: int) -> int:
    """The product of polynomials modulo zip's."""
    found = 0
    while one:
        if one & ONE:
            found ^= other
        one = one << 1 & 0xFFFFFFFF
        other = other >> 1 ^ (POLYNOMIAL if other & 1 else 0)
    return found


class NpzLayout:
    """Where each array's npy file begins in an npz file that holds them uncompressed, one after another."""

    def __init__(self, arrays: list[Stored]) -> None:
        """In this order."""
        self.arrays = arrays
        self.begins: dict[str, int] = {}
        self.end = 0
        for array in arrays:
            begin = self.end + LOCAL.size + len(array.member) + LOCAL_EXTRA.size
            self.begins[array.name] = begin
            self.end = begin + array.size

    def heads(self, crcs: dict[str, int]) -> list[tuple[int, bytes]]:
        """What stands before each npy file, and where; `crcs` are of the npy files."""
        heads = []
        for array in self.arrays:
            extra = LOCAL_EXTRA.pack(1, LOCAL_EXTRA.size - 4, array.size, array.size)
            sizes = crcs[array.name], IN_EXTRA, IN_EXTRA
            head = LOCAL.pack(b"PK\3\4", VERSION, 0, 0, 0, FIRST_DAY, *sizes, len(array.member), len(extra))
            heads.append((self._head(array), head + array.member + extra))
        return heads

    def tail(self, crcs: dict[str, int], comment: bytes) -> bytes:
        """What stands behind all."""
        directory = b""
        for array in self.arrays:
            extra = CENTRAL_EXTRA.pack(1, CENTRAL_EXTRA.size - 4, array.size, array.size, self._head(array))
            sizes = crcs[array.name], IN_EXTRA, IN_EXTRA
            lengths = len(array.member), len(extra), 0
            directory += CENTRAL.pack(
                b"PK\1\2", UNIX | VERSION, VERSION, 0, 0, 0, FIRST_DAY, *sizes, *lengths, 0, 0, MODE, IN_EXTRA
            )
            directory += array.member + extra
        count = len(self.arrays)
        end_64 = END_64.pack(
            b"PK\6\6", END_64.size - 12, UNIX | VERSION, VERSION, 0, 0, count, count, len(directory), self.end
        )
        locator = LOCATOR_64.pack(b"PK\6\7", 0, self.end + len(directory), 1)
        end = END.pack(b"PK\5\6", MANY, MANY, MANY, MANY, IN_EXTRA, IN_EXTRA, len(comment))
        return directory + end_64 + locator + end + comment

    def _head(self, array: Stored) -> int:
        return self.begins[array.name] - LOCAL.size - len(array.member) - LOCAL_EXTRA.size
