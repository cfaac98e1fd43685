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


@pytest.mark.skipif(not hasattr(_cpu, "read_rays"), reason="the system reads no files at places")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("columns", [6, 8])
def test_rays_are_read_from_any_place_of_a_file(tmp_path, dtype, columns):
    table = np.random.default_rng(3).random((40_000, columns)).astype(dtype)
    path, row = tmp_path / "rays", columns * table.itemsize
    path.write_bytes(bytes(100) + table.tobytes())
    count = len(table) - 7
    origins, directions = np.zeros((count, 3), dtype), np.zeros((count, 3), dtype)
    limits = [np.zeros(count, dtype) if columns == 8 else None for _ in range(2)]
    found, expected = _cpu.RunningChecksum(), _cpu.RunningChecksum()
    with path.open("rb") as file:
        number = file.fileno()
        read = _cpu.read_rays(number, 100 + 5 * row, origins, directions, *limits, found)
        assert read == count * row
        np.testing.assert_array_equal(origins, table[5:-2, :3])
        np.testing.assert_array_equal(directions, table[5:-2, 3:6])
        if columns == 8:
            np.testing.assert_array_equal(np.column_stack(limits), table[5:-2, 6:])
        for part in np.split(table[5:-2], [1, 20_000, 30_000]):
            expected.add(part.reshape(-1).view(np.uint8))
        assert found.both == expected.both
        assert _cpu.read_rays(number, 100 + 8 * row, origins, directions, *limits, None) == (count - 1) * row
    with pytest.raises(OSError, match="Bad file descriptor"):
        _cpu.read_rays(number, 0, origins, directions, *limits, None)
