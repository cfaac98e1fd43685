"""Colours of binary STL files, in the two forms that are in use."""

import struct

import numpy as np
import pytest
from support.damaged_colours import check_damaged
from support.mesh_files import STL_TEXT

import wive
from wive._internal.formats.colours import linear

RED, GREEN, BLUE, NONE = [0.8, 0, 0], [0, 0.8, 0], [0, 0, 0.8], [0.6] * 3
HALF = 0.8 * ((16 / 31 + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1, by hand, times the reflectance of white


def stl(attributes: list[int], header: bytes = b"") -> bytes:
    facets = b"".join(struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, one) for one in attributes)
    return header.ljust(80, b"\0") + struct.pack("<I", len(attributes)) + facets


def colours(attributes: list[int], header: bytes = b"") -> np.ndarray | None:
    return wive.load_colors(stl(attributes, header), file_type="stl")


def test_colours_of_viscam_begin_with_blue_and_have_the_highest_bit():
    found = colours([0x8000 | 31 << 10, 0x8000 | 31 << 5, 0x8000 | 31, 0x8000 | 16 << 10 | 16, 31, 0])
    assert found.dtype == np.float32
    assert found.shape == (6, 1, 3)
    np.testing.assert_allclose(found[:, 0], [RED, GREEN, BLUE, [HALF, 0, HALF], NONE, NONE], rtol=1e-6)


def test_colours_of_magics_begin_with_red_and_those_with_the_highest_bit_are_the_headers():
    header = b"some program COLOR=\x80\xff\x00\xff,MATERIAL=123412341234"
    of_all = 0.8 * linear(np.array([0x80, 255, 0]), 255)
    found = colours([31, 31 << 5, 31 << 10, 0x8000, 0xFFFF, 0], header)
    np.testing.assert_allclose(found[:, 0], [RED, GREEN, BLUE, of_all, of_all, [0, 0, 0]], rtol=1e-6)


def test_a_colour_in_the_header_alone_is_that_of_all_facets():
    found = colours([0, 0], b"COLOR=\x00\x00\xff\xff")
    np.testing.assert_allclose(found[:, 0], [BLUE, BLUE], rtol=1e-6)


@pytest.mark.parametrize("header", [b"", b"solid", b"x" * 80, b"x" * 71 + b"COLOR=\xff\xff\xff"])
def test_files_without_colours_have_none(header):
    assert colours([0, 0], header) is None
    assert wive.load_colors(STL_TEXT, file_type="stl") is None


@pytest.mark.parametrize("data", [b"\0", stl([31, 31])[:-1], stl([])])
def test_damaged_files_are_one_line_or_have_no_colours(data):
    try:
        assert wive.load_colors(data, file_type="stl") is None
    except ValueError as error:
        assert str(error).startswith("mesh (bytes): byte ")
        assert "\n" not in str(error)


def test_all_levels_of_a_colour_are_read():
    random = np.random.default_rng(9)
    attributes = random.integers(0, 0x8000, 500).tolist()
    channels = np.array([[one // 1024 % 32, one // 32 % 32, one % 32] for one in attributes])
    expected = 0.8 * linear(channels, 31)
    found = colours([one + 0x8000 for one in attributes])
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-6)
    found = colours(attributes, b"COLOR=1234")
    np.testing.assert_allclose(found[:, 0], expected[:, ::-1], rtol=1e-6)


def test_damaged_files_have_colours_that_fit_or_are_one_line():
    check_damaged(stl([31, 0x8001, 0], b"COLOR=1234"), "stl", 14)
    check_damaged(stl([31, 0x8001, 0]), "stl", 15)
