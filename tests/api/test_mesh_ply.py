"""PLY files, text and binary: every vertex, and every polygon or strip in its place."""

import numpy as np
import pytest
from support.mesh_files import POINTS, TRIANGLES, ply_binary, ply_header, ply_strips, ply_text
from support.refusals import refusal

import wive

TEXT = ply_text()
BINARY = ply_binary()
INTEGERS = ("char", "uchar", "short", "ushort", "int", "uint")


def load(data: bytes, dtype: type = np.float32):
    return wive.load_mesh(data, dtype, file_type="ply")


def assert_is_the_mesh(data: bytes) -> None:
    vertices, faces = load(data)
    assert vertices.tolist() == [list(point) for point in POINTS]
    assert faces.tolist() == TRIANGLES


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("real", ["float", "double"])
@pytest.mark.parametrize("count", INTEGERS)
@pytest.mark.parametrize("index", INTEGERS)
def test_a_binary_quad_and_triangle_of_any_types(order, real, count, index):
    assert_is_the_mesh(ply_binary(order, real, count, index))


ORDINARY = {
    "text": TEXT,
    "CRLF": TEXT.replace(b"\n", b"\r\n"),
    "CR": TEXT.replace(b"\n", b"\r"),
    "binary, header with CRLF": ply_header("binary_little_endian").replace(b"\n", b"\r\n")
    + BINARY[len(ply_header("binary_little_endian")) :],
    "no end of the last line": TEXT.rstrip(),
    "empty lines at the end": TEXT + b"\n \n",
    "tabs and blanks": TEXT.replace(b" 0 ", b" \t 0\t").replace(b"\n4 ", b"\n\t4 "),
    "vertex_index": TEXT.replace(b"vertex_indices", b"vertex_index"),
    "binary, vertex_index": BINARY.replace(b"vertex_indices", b"vertex_index"),
    "sized types": TEXT.replace(b"float ", b"float32 ").replace(b"uchar int", b"uint8 int32"),
    "comments anywhere": TEXT.replace(b"element", b"comment end_header\nobj_info element x\nelement"),
    "comment before the format": TEXT.replace(b"ply\n", b"ply\ncomment \xe4 \xff\n"),
    "trailing blanks in the header": TEXT.replace(b" x\n", b" x \t\n").replace(b"end_header", b"end_header "),
    "UTF-8 with a mark": b"\xef\xbb\xbf" + TEXT,
    "UTF-16": TEXT.decode().encode("utf-16"),
    "binary, padded": BINARY + b"\0" * 7 + b"\n",
    "faces of no rows": TEXT.replace(b"element edge 1", b"element tristrips 0\nelement edge 1"),
    "element without properties": TEXT.replace(b"element edge", b"element nothing 1000\nelement edge"),
}


@pytest.mark.parametrize("data", ORDINARY.values(), ids=ORDINARY)
def test_ordinary_files_give_their_triangles(data):
    assert_is_the_mesh(data)


def test_elements_and_lists_around_the_mesh_are_skipped():
    head = b"ply\nformat ascii 1.0\nelement camera 2\nproperty float f\nproperty list char float k\n"
    faces = b"element face 2\nproperty uchar a\nproperty list uchar int vertex_indices\n"
    faces += b"property list int float texcoord\nproperty int b\n"
    vertices = (
        b"element vertex 3\nproperty list uchar int n\nproperty int z\nproperty double x\nproperty int y\n"
    )
    text = head + faces + vertices + b"end_header\n1.5 2 1 nan\n0 0\n9 3 0 1 2 2 .5 .5 7\n8 3 2 1 0 0 6\n"
    text += b"1 4 7 .1 -2\n0 8 .2 -3\n2 5 5 9 .3 -4\n"
    vertices, found = load(text, np.float64)
    assert vertices.tolist() == [[0.1, -2, 7], [0.2, -3, 8], [0.3, -4, 9]]
    assert found.tolist() == [[0, 1, 2], [2, 1, 0]]
    binary = text[: text.index(b"end_header\n") + 11].replace(b"ascii", b"binary_big_endian")
    binary += np.array([1.5], ">f4").tobytes() + b"\2" + np.array([1, np.nan], ">f4").tobytes() + b"\0" * 5
    for a, corners, coordinates, b in ((9, [0, 1, 2], [0.5, 0.5], 7), (8, [2, 1, 0], [], 6)):
        binary += bytes([a, 3]) + np.array([*corners, len(coordinates)], ">i4").tobytes()
        binary += np.array(coordinates, ">f4").tobytes() + np.array([b], ">i4").tobytes()
    for more, z, x, y in (([4], 7, 0.1, -2), ([], 8, 0.2, -3), ([5, 5], 9, 0.3, -4)):
        binary += bytes([len(more)]) + np.array([*more, z], ">i4").tobytes()
        binary += np.array([x], ">f8").tobytes() + np.array([y], ">i4").tobytes()
    for array, expected in zip(load(binary, np.float64), (vertices, found), strict=True):
        np.testing.assert_array_equal(array, expected)


def test_double_coordinates_are_kept_and_rounded_once():
    for data in (ply_binary(real="double"), ply_text().replace(b"float x", b"double x")):
        assert load(data, np.float64)[0].dtype == np.float64
    survey = 4_512_345.123456789
    data = TEXT.replace(b"float x", b"double x").replace(b"\n0 0 0 7", b"\n%.9f 0 0 7" % survey)
    assert load(data, np.float64)[0][0, 0] == survey
    assert load(data)[0][0, 0] == np.float32(survey)


def test_strips_turn_every_second_triangle_over_and_begin_again_after_minus_one():
    _, faces = load(ply_strips("0 1 2 3 4 -1 2 3 4 -1 0 1", "-1 4 3 2 1", "0 0 1", "-1", ""))
    expected = [[0, 1, 2], [2, 1, 3], [2, 3, 4], [2, 3, 4], [4, 3, 2], [2, 3, 1], [0, 0, 1]]
    assert faces.tolist() == expected


def test_a_binary_file_of_one_size_of_polygon_is_the_same_as_text():
    quads = np.random.default_rng(3).integers(5, size=(50, 4))
    for count in ("uchar", "uint"):
        head = (
            BINARY[: BINARY.index(b"element face")] + b"element face 50\nproperty list %s int vertex_index\n"
        )
        body = BINARY[len(ply_header("binary_little_endian")) :][: 5 * 13]
        counts = {"uchar": "u1", "uint": "<u4"}[count]
        rows = np.empty(50, [("count", counts), ("corners", "<i4", 4)])
        rows["count"], rows["corners"] = 4, quads
        binary = load(head % count.encode() + b"end_header\n" + body + rows.tobytes())[1]
        text = TEXT[: TEXT.index(b"element face")] + head[head.index(b"element face") :] % count.encode()
        text += b"end_header\n" + b"".join(b"%g %g %g 7\n" % point for point in POINTS)
        text += b"".join(b"4 %d %d %d %d\n" % tuple(quad) for quad in quads)
        np.testing.assert_array_equal(binary, load(text)[1])


ROWS = "header: expected a line per row, 5 of `vertex`, 2 of `face`, 1 of `edge`, got {} lines"
REFUSED = {
    "cut after a face": (TEXT[: TEXT.index(b"3 3 2 4")], ROWS.format(6)),
    "more lines": (TEXT + b"1 2\n", ROWS.format(9)),
    "too few vertices": (TEXT.replace(b"\n0 0 0 7", b""), ROWS.format(7)),
    "fewer rows in the header": (TEXT.replace(b"face 2", b"face 1"), "header: expected a line per row"),
    "no face": (TEXT.replace(b"element face", b"element polygon"), "has no triangles"),
    "no vertex": (TEXT.replace(b"element vertex", b"element point"), "header: expected an element `vertex`"),
    "two numbers in a row": (TEXT.replace(b"\n1 0 0 7", b"\n1 0 7"), "line 18: expected more numbers"),
    "five numbers in a row": (
        TEXT.replace(b"\n1 0 0 7", b"\n1 0 0 7 7"),
        "line 18: expected no more numbers",
    ),
    "list too short": (TEXT.replace(b"3 3 2 4 1", b"4 3 2 4 1"), "line 23: expected more numbers"),
    "list cut": (TEXT.replace(b"3 3 2 4 1", b"9 3 2 4 1"), "line 23: expected all of the list"),
    "negative list": (TEXT.replace(b"3 3 2 4 1", b"-3 3 2 4 1"), "line 23: expected all of the list"),
    "index past the end": (TEXT.replace(b"3 3 2 4", b"3 3 2 5"), "face 1: expected an index from 0 to 4"),
    "negative index": (TEXT.replace(b"3 3 2 4", b"3 3 2 -4"), "face 1: expected an index from 0 to 4"),
    "fraction": (TEXT.replace(b"3 3 2 4", b"3 3 2 4.0"), "line 23: expected an integer, got '4.0'"),
    "two corners": (TEXT.replace(b"3 3 2 4 1", b"2 3 2 1"), "face 1: expected at least three corners, got 2"),
    "decimal comma": (
        TEXT.replace(b"0.5 2", b"0,5 2"),
        "line 21: expected a number, got '0,5': write decimal",
    ),
    "binary, index past the end": (BINARY[:-16] + b"\5" + BINARY[-15:], "face 1: expected an index"),
    "binary, cut in a face": (
        BINARY[:-20],
        f"byte {len(BINARY) - 20}, row 1 of element `face`: expected 2 rows",
    ),
    "binary, cut behind faces": (BINARY[:-1], f"byte {len(BINARY) - 1}, row 0 of element `edge`"),
    "binary, cut in the vertices": (
        BINARY[:-70],
        f"byte {len(BINARY) - 70}, row 3 of element `vertex`",
    ),
    "binary, more": (
        BINARY + b"abc",
        f"byte {len(BINARY)}: expected the file's end, got 3 bytes more",
    ),
    "binary, fewer faces in the header": (BINARY.replace(b"face 2", b"face 1"), "byte"),
    "strip past the end": (ply_strips("0 1 5"), "triangle strip 0: expected an index from 0 to 4"),
    "not PLY": (b"plo\n", "line 1: expected `ply`, got 'plo': not a PLY file"),
    "only ply": (b"ply\n", "line 2: expected `end_header`, got the file's end"),
    "no end_header": (TEXT[:200], "line 12: expected `end_header`"),
    "no format": (TEXT.replace(b"format ascii 1.0\n", b""), "line 15: expected a line `format`"),
    "other version": (TEXT.replace(b"ascii 1.0", b"ascii 2.0"), "line 2: expected a line of a PLY header"),
    "other format": (TEXT.replace(b"ascii", b"binary"), "line 2: expected a line of a PLY header"),
    "unknown type": (
        TEXT.replace(b"float y", b"half y"),
        "line 7: expected a line of a PLY header, got 'property half",
    ),
    "fractional count": (
        TEXT.replace(b"list uchar", b"list float"),
        "line 11: expected a line of a PLY header",
    ),
    "fractional index": (TEXT.replace(b"uchar int", b"uchar float"), "header: expected a list of integers"),
    "no list": (
        TEXT.replace(b"vertex_indices", b"corners"),
        "header: expected a list of integers `vertex_indices`",
    ),
    "no z": (
        TEXT.replace(b"float z", b"float w"),
        "header: expected a number `z` of element `vertex`, got the prop",
    ),
    "two x": (
        TEXT.replace(b"float y", b"float x"),
        "line 7: expected one property of a name, got a second 'x'",
    ),
    "two faces": (TEXT.replace(b"element edge", b"element face"), "line 13: expected one element of a name"),
    "property first": (
        b"ply\nformat ascii 1.0\nproperty float x\n",
        "line 3: expected a line of a PLY header",
    ),
    "UTF-16 without a mark": (TEXT.decode().encode("utf-16-le"), "line 1: expected `ply`"),
    "zero byte": (TEXT.replace(b"0.5 2", b"\0 2"), "line 21: expected text, got a zero byte"),
    "NaN": (TEXT.replace(b"0.5 2 0", b"nan 2 0"), "vertex 4 of triangle 2 must be finite float32 numbers"),
    "empty": (b"", "is empty"),
}


@pytest.mark.parametrize(("data", "expected"), REFUSED.values(), ids=REFUSED)
def test_what_can_not_be_right_is_refused_with_its_place(data, expected):
    found = refusal(data, "ply")
    assert found.startswith(expected)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (b"3 3 2 4 1", b"3 3 2 4", "expected more numbers, up to `"),
        (b"3 3 2 4 1", b"3 3 2 4 1 5", "expected no more numbers than element `"),
        (b"3 3 2 4 1", b"9 3 2 4 1", "expected all of the list `"),
        (b"0 1\n", b"0 1\n0 1\n", "expected a line per row, 5 of `"),
    ],
)
def test_long_names_are_cut_in_messages(old, new, expected):
    header, rows = ply_text().split(b"end_header")
    for word in (b"quality", b"edge"):
        header = header.replace(word, word * 200)
    text = refusal(header + b"end_header" + rows.replace(old, new), "ply")
    assert expected in text and len(text) < 250
