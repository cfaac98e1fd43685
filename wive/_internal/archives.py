"""Zip archives, read without trusting them: the members that are asked for, if their sizes can be true."""

from __future__ import annotations

import os
import zipfile
from typing import IO

# Deflate never makes more than this many bytes of one: a longer claim is false.
MOST_INFLATION = 1032
METHODS = {zipfile.ZIP_STORED: 1, zipfile.ZIP_DEFLATED: MOST_INFLATION}


class Archive:
    """The members of a zip archive by name, the last of each name.

    On damaged bytes it raises what zipfile and zlib raise: BadZipFile, OSError, ValueError and others.
    """

    def __init__(self, file: IO[bytes]) -> None:
        """Read the table of contents."""
        self._size = file.seek(0, os.SEEK_END)
        self._archive = zipfile.ZipFile(file)
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
        return self._archive.open(info), info.file_size

    def packed_size(self, name: str) -> int:
        """The number of bytes of a member in the archive."""
        return self._members[name].compress_size

    def size(self, name: str) -> int:
        """The number of bytes that a member claims to unpack to."""
        return self._members[name].file_size
