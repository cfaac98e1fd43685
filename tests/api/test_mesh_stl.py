"""STL files, text and binary: three vertices per facet, in the file's order."""

import struct

import numpy as np
import pytest
from support.mesh_files import FACET, STL_TEXT, stl_binary
from support.refusals import refusal

import wive


def load(data: bytes, dtype: type = np.float32):
    return wive.load_mesh(data, dtype, file_type="stl")


TWO = [[0, 0, 0], [1, 0, 0], [0, 1, 0]] * 2
ORDINARY = {
    "text": STL_TEXT,
    "no endsolid": STL_TEXT[: STL_TEXT.index(b"endsolid")],
    "no name": STL_TEXT.replace(b" a name", b""),
    "keywords in the name": STL_TEXT.replace(b"a name", b"facet vertex 1 2 3 endsolid"),
    "upper case": STL_TEXT.upper(),
    "CRLF": STL_TEXT.replace(b"\n", b"\r\n"),
    "CR": STL_TEXT.replace(b"\n", b"\r"),
    "tabs": STL_TEXT.replace(b" ", b"\t"),
    "on fewer lines": STL_TEXT.replace(b"\n  ", b" "),
    "on one line": STL_TEXT.replace(b"\n", b" "),
    "a facet behind the name": STL_TEXT.replace(b"name\nf", b"facet normal f"),
    "a facet of no normal behind the name": STL_TEXT.replace(
        b"name\nfacet normal 0 0 1", b"b facet normal nan nan nan"
    ),
    "an end behind a facet": STL_TEXT.replace(b"endfacet\nend", b"endfacet end"),
    "two solids on one line": (b"solid a\n" + FACET + b"endsolid a\nsolid b\n" + FACET).replace(b"\n", b" "),
    "solid in names": STL_TEXT.replace(b"a name", b"solid my solid end solid"),
    "two solids": b"solid a\n" + FACET + b"endsolid a\nsolid b\n" + FACET + b"endsolid b\n",
    "two solids without ends": b"solid a\n" + FACET + b"solid\n" + FACET,
    "end solid": b"solid a\n" + FACET * 2 + b"end solid\n",
    "mark": b"\xef\xbb\xbf" + STL_TEXT,
    "Latin-1 name": STL_TEXT.replace(b"a name", b"stuhl gr\xfcn"),
    "UTF-16": STL_TEXT.decode().encode("utf-16"),
    "normals of no number": STL_TEXT.replace(b"0 0 1", b"-nan(ind) 1.#QNAN x"),
    "no end of the last line": STL_TEXT.rstrip(),
    "binary": stl_binary(2),
    "binary, header begins with solid": stl_binary(2, header=b"solid\nfacet normal"),
    "binary, trailing bytes": stl_binary(2, more=b"made by hand"),
    "binary, solid and trailing bytes": stl_binary(2, header=b"solid", more=b"\n"),
    "binary, padded by the size of a facet": stl_binary(2, more=b"\0" * 50),
}


@pytest.mark.parametrize("data", ORDINARY.values(), ids=ORDINARY)
def test_ordinary_files_give_their_triangles(data):
    vertices, faces = load(data)
    assert vertices.tolist() == TWO
    assert faces.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_facets_keep_their_order_and_their_float32_numbers():
    random = np.random.default_rng(4)
    corners = random.normal(size=(20, 3, 3)).astype(np.float32)
    facets = np.zeros(20, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
    facets["corners"], facets["color"] = corners, random.integers(1 << 16, size=20)
    text = "solid x\n"
    for a, b, c in corners.tolist():
        text += "facet normal 0 0 0\nouter loop\n"
        text += "".join("vertex {!r} {!r} {!r}\n".format(*point) for point in (a, b, c))
        text += "endloop\nendfacet\n"
    for data in (b" " * 80 + struct.pack("<I", 20) + facets.tobytes(), text.encode()):
        for dtype in (np.float32, np.float64):
            vertices, faces = load(data, dtype)
            np.testing.assert_array_equal(vertices[faces], corners)


BINARY = stl_binary(3)
FOURTH = STL_TEXT.replace(b"  endloop", b"  vertex 1 1 1\n  endloop", 1)
REFUSED = {
    "binary, cut": (
        BINARY[:-20],
        "byte 214: expected 3 facets, as the header has, got the file's end after 2",
    ),
    "binary, count too large": (
        stl_binary(3, count=4),
        "byte 234: expected 4 facets, as the header has, got",
    ),
    "binary, count too small": (
        stl_binary(3, count=1),
        "byte 80: expected the number of facets, 3 by the file's",
    ),
    "binary, count of none": (
        stl_binary(3, count=0),
        "byte 80: expected the number of facets, 3 by the file's",
    ),
    "binary, solid and cut": (
        stl_binary(3, header=b"solid")[:-1],
        "byte 233: expected 3 facets, as the header",
    ),
    "binary, no facets": (stl_binary(0), "has no triangles"),
    "binary, header cut": (BINARY[:82] + b"\0", "byte 83: expected 84 bytes of a header, got the file's end"),
    "text, no facets": (b"solid a\nendsolid a\n", "has no triangles"),
    "text, four vertices": (FOURTH, "line 7: expected `endloop`, got 'vertex 1 1 1'"),
    "text, two vertices": (
        STL_TEXT.replace(b"   vertex 1 0 0\n", b"", 1),
        "line 6: expected `vertex`, got 'endloop'",
    ),
    "text, two numbers": (STL_TEXT.replace(b"1 0 0", b"1 0", 1), "line 6: expected `vertex`, got '0'"),
    "text, cut": (STL_TEXT[:150], "line 10: expected `vertex`, got the file's end"),
    "text, no solid": (FACET, "line 1: expected `solid`, got 'facet normal 0 0 1"),
    "text, decimal comma": (
        STL_TEXT.replace(b"1e0", b"1,0", 1),
        "line 6: expected a number, got '1,0': write",
    ),
    "text, NaN": (
        STL_TEXT.replace(b"1e0", b"nan", 1),
        "vertex 2 of triangle 0 must be finite float32 numbers",
    ),
    "text, infinite": (STL_TEXT.replace(b"1e0", b"1.#INF", 1), "line 6: expected a number, got '1.#inf'"),
    "other text": (b"<html>not found</html>", "line 1: expected `solid`, got '<html>not found</htm'"),
    "empty": (b"", "is empty"),
}


@pytest.mark.parametrize(("data", "expected"), REFUSED.values(), ids=REFUSED)
def test_what_can_not_be_right_is_refused_with_its_place(data, expected):
    assert refusal(data, "stl").startswith(expected)


def test_binary_facets_of_no_number_are_refused():
    data = bytearray(BINARY)
    data[84 + 50 + 12 + 4 : 84 + 50 + 12 + 8] = struct.pack("<f", np.nan)
    with pytest.raises(ValueError, match="vertex 3 of triangle 1 must be finite float32 numbers"):
        load(bytes(data))
