"""What the core does for streams: checksums of zip archives, and tables of rays as origins and directions."""

import zlib

import numpy as np
import pytest

from wive import _cpu


def test_checksums_are_those_of_zip():
    data = np.random.default_rng(1).integers(0, 256, 5000, np.uint8)
    for length in [*range(300), 1023, 4096, 4999]:
        for begin in (0, 1):
            part = data[begin : begin + length]
            for before in (0, 1, 0xFFFFFFFF, 0x12345678):
                assert _cpu.crc32(part, before) == zlib.crc32(part, before)
    parts = np.split(data, [1, 64, 65, 200, 1000, 1063])
    crc = 0
    for part in parts:
        crc = _cpu.crc32(part, crc)
    assert crc == zlib.crc32(data)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("columns", [6, 8])
def test_tables_are_split_into_origins_and_directions(dtype, columns):
    table = np.random.default_rng(2).random((1001, columns)).astype(dtype)
    origins, directions = np.zeros((1003, 3), dtype), np.zeros((1003, 3), dtype)
    _cpu.split_rays(table, origins[1:-1], directions[1:-1])
    np.testing.assert_array_equal(origins[1:-1], table[:, :3])
    np.testing.assert_array_equal(directions[1:-1], table[:, 3:6])
    assert not origins[[0, -1]].any() and not directions[[0, -1]].any()


@pytest.mark.parametrize(
    ("table", "origins", "directions"),
    [((5, 5), (5, 3), (5, 3)), ((5, 6), (4, 3), (5, 3)), ((5, 6), (5, 3), (6, 3)), ((30,), (5, 3), (5, 3)),
     ((5, 6), (5, 4), (5, 3)), ((5, 6), (5, 3), (15,))],
)  # fmt: skip
def test_tables_of_other_shapes_are_refused(table, origins, directions):
    arrays = [np.zeros(shape, np.float32) for shape in (table, origins, directions)]
    with pytest.raises(ValueError, match="expected"):
        _cpu.split_rays(*arrays)
