"""Zip archives, read without trusting them: the members that are asked for, if their sizes can be true."""

from __future__ import annotations

import io
import os
import struct
import zipfile
from collections.abc import Callable
from typing import IO, Any, cast

import numpy as np

from wive import _cpu

# Deflate never makes more than this many bytes of one: a longer claim is false.
MOST_INFLATION = 1032
METHODS = {zipfile.ZIP_STORED: 1, zipfile.ZIP_DEFLATED: MOST_INFLATION}
# The lengths of a member's name and extra field, and their place in its head (APPNOTE.TXT 4.3.7), whose fixed
# part has so many bytes.
LENGTHS, LENGTHS_AT, HEAD = struct.Struct("<2H"), 26, 30
# Bytes that are summed up while they are in a cache.
SKIPPED = 1 << 18


class Archive:
    """The members of a zip archive by name, the last of each name.

    On damaged bytes it raises what zipfile and zlib raise: BadZipFile, OSError, ValueError and others.
    """

    def __init__(self, file: IO[bytes]) -> None:
        """Read the table of contents."""
        self._size = file.seek(0, os.SEEK_END)
        self._file, self._archive = file, zipfile.ZipFile(file)
        self._members = {info.filename: info for info in self._archive.infolist()}
        self.names = list(self._members)

    def open(self, name: str) -> tuple[IO[bytes], int]:
        """A stream of the member's bytes, and their number; ValueError if the number can't be true."""
        info = self._members[name]
        if info.flag_bits & 1:
            raise ValueError("is encrypted")
        most = METHODS.get(info.compress_type)
        if most is None:
            raise ValueError(f"compressed by method {info.compress_type}, expected stored or deflated")
        if info.compress_size > self._size or info.file_size > most * info.compress_size:
            raise ValueError(f"claims {info.file_size} bytes from {info.compress_size}")
        stream = self._archive.open(info)  # compares the head with the table of contents
        read_at = _reader_of(self._file)
        if info.compress_type != zipfile.ZIP_STORED or read_at is None:
            return stream, info.file_size
        stream.close()
        lengths = bytearray(LENGTHS.size)
        read_at(lengths, info.header_offset + LENGTHS_AT)
        begin = info.header_offset + HEAD + sum(LENGTHS.unpack(lengths))
        return cast(IO[bytes], _Stored(read_at, begin, info)), info.file_size

    def packed_size(self, name: str) -> int:
        """The number of bytes of a member in the archive."""
        return self._members[name].compress_size

    def size(self, name: str) -> int:
        """The number of bytes that a member claims to unpack to."""
        return self._members[name].file_size


ReadAt = Callable[[Any, int], int]  # fills a buffer with bytes from a place of the file on, returns how many


def _reader_of(file: IO[bytes]) -> ReadAt | None:
    """What reads a file of the system whatever its position; None for others."""
    try:
        number = file.fileno()
    except OSError:
        return None
    return (lambda buffer, place: os.preadv(number, [buffer], place)) if hasattr(os, "preadv") else None


class _Stored(io.RawIOBase):
    """A member that is not compressed, read where it lies: zipfile copies small parts of it, several times.

    Its checksum is compared when its end is reached. What is skipped is read as well.
    """

    def __init__(self, read_at: ReadAt, begin: int, info: zipfile.ZipInfo) -> None:
        """From byte `begin` of the file on."""
        self._read_at, self._begin, self._info = read_at, begin, info
        self._at = self._crc = 0

    def readable(self) -> bool:
        """Yes."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fill the buffer; BadZipFile if the last byte is reached and the checksum is wrong."""
        part = memoryview(buffer).cast("B")[: self._info.file_size - self._at]
        count = self._read_at(part, self._begin + self._at) if part else 0
        self._crc = _cpu.crc32(np.frombuffer(part[:count], np.uint8), self._crc)
        self._at += count
        if self._at == self._info.file_size and self._crc != self._info.CRC:
            raise zipfile.BadZipFile(f"Bad CRC-32 for file {self._info.filename!r}")
        return count

    def seek(self, place: int, whence: int = os.SEEK_SET) -> int:
        """Go forward; UnsupportedOperation for going back."""
        begins = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._info.file_size}
        left = begins[whence] + place - self._at
        if left < 0:
            raise io.UnsupportedOperation("a member of an archive is read from front to back")
        skipped = bytearray(min(left, SKIPPED))
        while left > 0 and (count := self.readinto(memoryview(skipped)[:left])):
            left -= count
        return self._at
