"""Checksums of npz files that are written in parts."""

import zlib

import numpy as np
import pytest

from wive._internal.npz_layout import joined_crc


@pytest.mark.parametrize("length", [0, 1, 7, 8, 127, 4096, 100_001])
def test_the_checksum_of_two_parts_is_that_of_both(length):
    random = np.random.default_rng(length)
    for first in (b"", b"\0" * 9, random.bytes(33)):
        second = random.bytes(length)
        assert joined_crc(zlib.crc32(first), zlib.crc32(second), length) == zlib.crc32(first + second)
