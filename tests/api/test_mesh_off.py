"""OFF files and their variants: a vertex or a face per line."""

import numpy as np
import pytest
from support.refusals import refusal

import wive

POINTS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 2, 0]]
TRIANGLES = [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
VERTICES = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n.5 2 0\n"
FACES = "4 0 1 2 3\n3 3 2 4\n"
OFF = "OFF\n5 2 0\n" + VERTICES + FACES


def load(text: str | bytes, dtype: type = np.float32):
    return wive.load_mesh(text.encode() if isinstance(text, str) else text, dtype, file_type="off")


ORDINARY = {
    "plain": OFF,
    "two counts": OFF.replace("\n5 2 0", "\n5 2"),
    "counts in the first line": OFF.replace("OFF\n", "OFF "),
    "no blank behind OFF": OFF.replace("OFF\n", "OFF"),
    "comments": "# a\n\n" + OFF.replace("\n", " # b\n\n#c\n"),
    "CRLF": OFF.replace("\n", "\r\n"),
    "CR": OFF.replace("\n", "\r"),
    "tabs": OFF.replace(" ", "\t"),
    "indented": OFF.replace("\n", "\n  "),
    "no end of the last line": OFF.rstrip(),
    "mark": "\ufeff" + OFF,
    "UTF-16": OFF.encode("utf-16"),
    "face colours": OFF.replace("3\n3", "3 255 0 0\n3").replace("2 4\n", "2 4 .1 .2 .3 .4\n"),
    "colours": "C" + OFF.replace(VERTICES, VERTICES.replace("\n", " 255 0 0 255\n")),
    "normals": "N" + OFF.replace(VERTICES, VERTICES.replace("\n", " 0 0 1\n")),
    "normals and colours": "CN" + OFF.replace(VERTICES, VERTICES.replace("\n", " 0 0 1 .5 .5 .5 1\n")),
    "texture": "ST" + OFF.replace(VERTICES, VERTICES.replace("\n", " 0 1\n")),
    "all": "STCN" + OFF.replace(VERTICES, VERTICES.replace("\n", " 0 0 1 .5 .5 .5 1 0 1\n")),
    "colours without a letter": OFF.replace(VERTICES, VERTICES.replace("\n", " 255 0 0\n")),
}


@pytest.mark.parametrize("text", ORDINARY.values(), ids=ORDINARY)
def test_ordinary_files_give_their_triangles(text):
    vertices, faces = load(text)
    assert vertices.tolist() == POINTS
    assert faces.tolist() == TRIANGLES


LINES = "line 2: the header has 5 vertices and 2 faces, a line each, and {} lines follow"
REFUSED = {
    "cut after a face": (OFF[: OFF.index("3 3 2 4")], LINES.format(6)),
    "cut in the vertices": ("OFF\n5 2 0\n0 0 0\n", LINES.format(1)),
    "more lines": (OFF + "3 0 1 2\n", LINES.format(8)),
    "fewer in the header": (OFF.replace("5 2", "5 1"), "line 2: the header has 5 vertices and 1 faces"),
    "more in the header": (OFF.replace("5 2", "6 2"), "line 2: the header has 6 vertices"),
    "negative count": (OFF.replace("5 2", "-5 2"), "line 2: the header has -5 vertices"),
    "one count": (OFF.replace("5 2 0", "5"), "line 2: expected the number of vertices"),
    "fractional count": (OFF.replace("5 2", "5.0 2"), "line 2: expected an integer"),
    "edges of no number": (OFF.replace("5 2 0", "5 2 x"), "line 2: expected an integer, got 'x'"),
    "no counts": ("OFF\n", "line 1: expected the number of vertices"),
    "no header": (OFF[4:], "line 1: expected a header such as OFF"),
    "lower case": ("off" + OFF[3:], "line 1: expected a header such as OFF, COFF or NOFF, got 'off'"),
    "four coordinates": ("4" + OFF, "line 1: 4OFF has vertices of other than three coordinates"),
    "n coordinates": ("n" + OFF, "line 1: nOFF has vertices of other than three coordinates"),
    "binary": (b"OFF BINARY\n\0\0\0\5", "line 1: binary OFF is not read: save the mesh as text, or as PLY"),
    "two coordinates": (
        OFF.replace(".5 2 0", ".5 2"),
        "line 7: expected a vertex of three numbers, got '.5 2'",
    ),
    "two corners": (
        OFF.replace("3 3 2 4", "2 3 2"),
        "line 9: expected a face of at least three corners, got '2 3 2'",
    ),
    "list cut": (
        OFF.replace("3 3 2 4", "4 3 2 4"),
        "line 9: expected as many corners as the line's first number",
    ),
    "negative list": (OFF.replace("3 3 2 4", "-3 3 2 4"), "line 9: expected a face of at least three"),
    "index past the end": (OFF.replace("3 3 2 4", "3 3 2 5"), "line 9: expected an index from 0 to 4, the"),
    "negative index": (OFF.replace("3 3 2 4", "3 3 2 -1"), "line 9: expected an index from 0 to 4, the"),
    "fraction": (OFF.replace("3 3 2 4", "3 3 2 4.0"), "line 9: expected an integer, got '4.0'"),
    "decimal comma": (OFF.replace(".5 2", "0,5 2"), "line 7: expected a number, got '0,5': write decimal"),
    "infinite": (OFF.replace(".5 2", "inf 2"), "vertex 4 of triangle 2 must be finite float32 numbers"),
    "no faces": ("OFF\n1 0 0\n0 0 0\n", "has no triangles"),
}


@pytest.mark.parametrize(("text", "expected"), REFUSED.values(), ids=REFUSED)
def test_what_can_not_be_right_is_refused_with_its_line(text, expected):
    assert refusal(text, "off").startswith(expected)


def test_numbers_of_surveys_are_kept():
    text = OFF.replace(".5 2", "4512345.123456789 2")
    assert load(text, np.float64)[0][4, 0] == 4512345.123456789
    assert load(text)[0][4, 0] == np.float32(4512345.123456789)
