"""OBJ files: their vertices and polygons, line by line, as they stand."""

import struct

import numpy as np
import pytest
from support.mesh_files import TRIANGLE
from support.refusals import refusal

import wive


def load(text: str | bytes, dtype: type = np.float32):
    return wive.load_mesh(text.encode() if isinstance(text, str) else text, dtype, file_type="obj")


V = TRIANGLE.decode()


def test_triangles_keep_the_order_of_their_lines_whatever_groups_they_are_in():
    random = np.random.default_rng(1)
    heights = random.permutation(60)
    statements = [
        "usemtl m{}",
        "g a b{}",
        "o part{}",
        "s {}",
        "s off",
        "usemtl (null)",
        "mtllib no such {}.mtl",
        "",
    ]
    text = ""
    for number, z in enumerate(heights):
        text += "".join(f"v {x} {y} {z}\n" for x, y in ((0, 0), (1, 0), (0, 1)))
        text += statements[random.integers(len(statements))].format(random.integers(3)) + "\n"
        text += f"f {3 * number + 1} {3 * number + 2} {3 * number + 3}\n"
    vertices, faces = load(text)
    assert vertices[faces][:, 0, 2].tolist() == heights.tolist()


def test_every_vertex_stays_used_or_not_equal_or_not():
    vertices, faces = load("v 9 9 9\n" + V + V + "f 2 3 7\n")
    assert vertices.tolist() == [[9, 9, 9]] + [[0, 0, 0], [1, 0, 0], [0, 1, 0]] * 2
    assert faces.tolist() == [[1, 2, 6]]


def test_relative_indices_count_from_their_line():
    _, faces = load("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 5\nf -1 -3/-1 -2//-1\nf 1 -3 4\n")
    assert faces.tolist() == [[0, 1, 2], [3, 1, 2], [0, 1, 3]]


def test_a_face_may_stand_before_its_vertices():
    assert load("f 1 2 3\n" + V)[1].tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("face", ["1 2 3", "1/1 2/1 3/1", "1//1 2//1 3//1", "1/1/1 2/1/1 3/1/1", "1/ 2/ 3/"])
@pytest.mark.parametrize("other", ["1 2 3", "1/1/1 2//1 3/1", "+1 2 +3"])
def test_corner_forms_may_differ(face, other):
    assert load(V + f"vt 0 0\nvn 0 0 1\nf {face}\nf {other}\n")[1].tolist() == [[0, 1, 2]] * 2


ORDINARY = {
    "tabs": (V + "f 1 2 3\n").replace(" ", "\t"),
    "several blanks": (V + "f 1 2 3\n").replace(" ", " \t  "),
    "indented": "".join(f"  {line}\n" for line in (V + "f 1 2 3").split("\n")),
    "blanks at the ends of lines": (V + "f 1 2 3\n").replace("\n", " \t\n"),
    "no end of the last line": V + "f 1 2 3",
    "CRLF": (V + "f 1 2 3\n").replace("\n", "\r\n"),
    "CR": (V + "f 1 2 3\n").replace("\n", "\r"),
    "empty lines": (V + "f 1 2 3\n").replace("\n", "\n\n \n"),
    "comments": "# a\n" + V.replace("\n", " # f 9 9 9\n") + "#f 7 8 9\nf 1 2 3 # floor\n",
    "comment without a blank": V + "f 1 2 3#floor\n",
    "comment behind a point": V.replace("0 0 0\n", "0. 0. 0.# f 9 9 9\n") + "f 1 2 3\n",
    "comment that ends in a backslash": "# C:\\meshes\\\n" + V + "f 1 2 3\n",
    "name that ends in a backslash": V + "mtllib C:\\meshes\\\nf 1 2 3\nusemtl a\\ \\\n",
    "continued": V + "f 1 \\\n 2 \\ \n3\n",
    "continued, CRLF": V + "f 1 \\\r\n 2 3\r\n",
    "continued vertex": "v 0 \\\n0 0\n" + V[8:] + "f 1 2 3\n",
    "UTF-8 with a mark": "\ufeff" + V + "f 1 2 3\n",
    "UTF-8": "# größe\ng stüble\n" + V + "f 1 2 3\n",
    "Latin-1": ("g st\xfchle \xa0 \x85\n" + V + "f 1 2 3\n").encode("latin-1"),
    "UTF-16": ("g st\xfchle\n" + V + "f 1 2 3\n").encode("utf-16"),
    "UTF-16, big-endian": b"\xfe\xff" + (V + "f 1 2 3\n").encode("utf-16-be"),
    "UTF-32": (V + "f 1 2 3\n").encode("utf-32"),
    "Ctrl-Z": V + "f 1 2 3\n\x1a",
    "weights": V.replace("0\n", "0 1\n") + "f 1 2 3\n",
    "colours": V.replace("0\n", "0 .5 1 1e-1\n") + "f 1 2 3\n",
    "weights and colours": V.replace("0\n", "0 1 .5 .5 .5\n") + "f 1 2 3\n",
    "lines and points": V + "l 1 2 3 1\np 1 2\nf 1 2 3\nl 1/1 2/2\n",
    "other statements": V + "vp 1\nmg off\nlod 1\nbevel on\nshadow_obj a\nf 1 2 3\n",
    "old face": V + "fo 1 2 3\n",
    "trailing names": V + "usemtl\ng\no\ns\nf 1 2 3\n",
}


@pytest.mark.parametrize("text", ORDINARY.values(), ids=ORDINARY)
def test_ordinary_files_give_their_triangle(text):
    vertices, faces = load(text)
    assert vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert faces.tolist() == [[0, 1, 2]]


REFUSED = {
    V + "f 0 1 2\n": "line 4: expected an index from 1 to 3, the file's vertices, got 0",
    V + "f 1 2 4\n": "line 4: expected an index from 1 to 3, the file's vertices, got 4",
    V + "\nf -4 1 2\n": "line 5: expected an index from -3, the first vertex before this line, to -1, got -4",
    "f -1 -2 -3\n" + V: "line 1: expected an index from",
    V + "f 1 2 99999999999999999999\n": "line 4: expected an index from 1 to 3",
    V + "f 1 2\n": "line 4: expected a face of at least three corners, got 'f 1 2'",
    V + "f\n": "line 4: expected a face of at least three corners, got 'f'",
    V + "f 1 2 3.0\n": "line 4: expected an integer, got '3.0'",
    V + "f 1 2 3e0\n": "line 4: expected an integer, got '3e0'",
    V + "f 1 2 x\n": "line 4: expected an integer, got 'x'",
    V + "f 1 2 1_0\n": "line 4: expected an integer, got '1_0'",
    V + "f 1 2 0x3\n": "line 4: expected an integer, got '0x3'",
    V + "f 1,2,3\n": "line 4: expected a face of at least three corners, got 'f 1,2,3'",
    V + "f /1 2 3\n": "line 4: expected an integer, got '/1'",
    V + "f 1/1/1/1 2 3\n": "line 4: expected a corner such as 1, 1/2, 1//3 or 1/2/3, got '1/1/1/1'",
    V + "f 1/a 2 3\n": "line 4: expected a corner such as",
    "v 1,5 2 3\n" + V + "f 1 2 3\n": "line 1: expected a number, got '1,5': write decimal points, not commas",
    "v 1.5.2 3 4\n" + V + "f 1 2 3\n": "line 1: expected a number, got '1.5.2'",
    "v 1-2 3 4\n" + V + "f 1 2 3\n": "line 1: expected a number, got '1-2'",
    "v 1 2 1_0\n" + V + "f 1 2 3\n": "line 1: expected a number, got '1_0'",
    "v 1 2 0x10\n" + V + "f 1 2 3\n": "line 1: expected a number, got '0x10'",
    "v 1 2 1d5\n" + V + "f 1 2 3\n": "line 1: expected a number, got '1d5'",
    "v 0 0 1.#INF\n" + V + "f 1 2 3\n": "line 1: expected a number, got '1.#INF'",
    "v 0 0 -1.#IND\n" + V + "f 1 2 3\n": "line 1: expected a number, got '-1.#IND'",
    "v 0 0 0 red 1 1\n" + V + "f 1 2 3\n": "line 1: expected a number, got 'red'",
    "v 1 2\n"
    + V
    + "f 1 2 3\n": "line 1: expected 3 numbers, 4 with a weight or 6 to 8 with a colour, got 'v 1 2'",
    "v 1 2 3 4 5\n" + V + "f 1 2 3\n": "line 1: expected 3 numbers",
    "v 0 \\\n0 0\nv 1 2\n" + V + "f 1 2 3\n": "line 3: expected 3 numbers",
    V
    + "cstype bezier\nsurf 0 1 0 1 1 2 3\nend\nf 1 2 3\n": "line 5: `surf`, a free-form surface, is not read",
    V + "call other.obj\nf 1 2 3\n": "line 4: `call`, another file's statements, is not read",
    V + "1 2 3\n": "line 4: expected a statement of OBJ, got '1 2 3': comments begin with #",
    V + "F 1 2 3\n": "line 4: expected a statement of OBJ, got 'F 1 2 3'",
    V + "f1 2 3\n": "line 4: expected a statement of OBJ, got 'f1 2 3'",
    V + "f 1 2 3\0\n": "line 4: expected text, got a zero byte",
    "v nan 0 0\n"
    + V
    + "f 1 2 3\n": "vertex 0 of triangle 0 must be finite float32 numbers, got [nan, 0.0, 0.0]",
    V
    + "v 0 0 1e39\nf 1 2 4\n": "vertex 3 of triangle 0 must be finite float32 numbers, got [0.0, 0.0, inf]: "
    "if the file has larger numbers, load it with dtype=np.float64",
    V: "has no triangles",
    V + "l 1 2\n": "has no triangles",
    " \n": "has no triangles",
    "": "is empty",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_can_not_be_right_is_refused_with_its_line(text):
    assert refusal(text, "obj").startswith(REFUSED[text])


def test_utf_16_that_is_not_is_refused():
    assert "begins as UTF-16 text, and is not" in refusal(b"\xff\xfe" + V.encode() + b"\n", "obj")


def test_unused_vertices_may_be_anything_and_larger_numbers_fit_float64():
    vertices, _ = load("v nan -inf 1e999\n" + V + "f 2 3 4\n")
    assert vertices[1:].tolist() == load(V + "f 1 2 3\n")[0].tolist()
    assert load(V + "v 0 0 1e39\nf 1 2 4\n", np.float64)[0][3, 2] == 1e39


def test_numbers_are_those_of_the_text():
    words = ["1.", ".5", "1e-3", "-0", "+2", "1E5", "-.25e+1", "007", "1e-50", "0.1"]
    text = "".join(f"v {word} 0 0\n" for word in words) + "f 1 2 3\n"
    for dtype in (np.float32, np.float64):
        found = load(text, dtype)[0][:, 0]
        np.testing.assert_array_equal(found, np.array([float(word) for word in words], dtype))
        assert np.signbit(found[3])


def nearest_float32(word: str) -> float:
    """By exact arithmetic; ties go to the even one."""
    from fractions import Fraction

    exact = Fraction(word)
    guess = np.float32(float(word))
    near = [guess, np.nextafter(guess, np.float32(-np.inf)), np.nextafter(guess, np.float32(np.inf))]
    bits = [struct.unpack("<I", struct.pack("<f", value))[0] for value in near]
    return float(
        min(
            zip(near, bits, strict=True),
            key=lambda each: (abs(Fraction(float(each[0])) - exact), each[1] % 2),
        )[0]
    )


def test_decimal_numbers_are_rounded_once():
    random = np.random.default_rng(5)
    words = []
    values = random.normal(size=60) * 10.0 ** random.integers(-42, 30, 60)
    for value in values.astype(np.float32):
        middle = (float(value) + float(np.nextafter(value, np.float32(np.inf)))) / 2
        exact = f"{middle:.170f}" if abs(middle) < 1 else f"{middle:.60f}"
        # Half-way, and so little beside it that float64 can't tell.
        words += [exact, exact + "1", exact.replace("-", "-0")[:-1] + "0", repr(middle)]
        words.append(exact[:-30] if set(exact[-30:]) == {"0"} else exact)
    words += [
        "16777217.00000000000000000000001",
        "16777216.99999999999999999999999",
        "1.4012984643248171e-45",
    ]
    found = load("".join(f"v {word} 0 0\n" for word in words) + "f 1 2 3\n")[0][:, 0]
    assert found.tolist() == [nearest_float32(word) for word in words]
    twice = np.array([float(word) for word in words]).astype(np.float32)
    assert (twice != found).sum() > 20


@pytest.mark.parametrize("first", range(5))
def test_a_concave_polygon_is_not_hit_in_its_notch(first):
    corners = [(0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)]
    text = "".join(f"v {x} {y} 0\n" for x, y in corners)
    text += "f " + " ".join(str((first + number) % 5 + 1) for number in range(5)) + "\n"
    scene = wive.Scene(*load(text), accuracy="exact")
    origins = np.float32([[1.5, 1.4, 5], [0.5, 1, 5], [1, 0.25, 5], [1, 1.5, 5], [0.1, 1.7, 5]])
    assert scene.occluded(origins, [0, 0, -1]).tolist() == [False, True, True, False, True]
    assert scene.count(origins, [0, 0, -1]).tolist() == [0, 1, 1, 0, 1]


def test_polygons_become_triangles_in_their_place():
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .5 2 0\n"
    faces = load(square + "f 1 2 3\nf 1 2 3 4\nf 4 3 5\nf 1 2 3 5 4\n")[1]
    assert faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 2, 4], [0, 1, 2], [0, 2, 4], [0, 4, 3]]
