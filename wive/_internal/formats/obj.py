"""Wavefront OBJ: every `v` is a vertex and every `f` a polygon, in the order of their lines.

Groups, objects, materials, normals, texture coordinates, weights and colours of vertices, points and lines
are skipped.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats import Mesh
from wive._internal.formats.text import COMMENT, JOINED, Bools, Ints, Text, plain
from wive._internal.formats.triangulate import triangulate

SKIPPED = frozenset(
    b"vt vn vp g o s mg usemtl mtllib usemap maplib l p bevel c_interp d_interp lod shadow_obj trace_obj "
    b"cstype deg bmat step curv curv2 parm trim hole scrv sp end con ctech stech cdc res".split()
)
# Statements that stand for surfaces, or read other files: skipping them would lose triangles.
REFUSED = {
    b"surf": "a free-form surface",
    b"bzp": "a Bezier patch",
    b"bsp": "a B-spline patch",
    b"cdp": "a Cardinal patch",
    b"call": "another file's statements",
    b"csh": "a command",
}
# Numbers of a vertex: x y z, with a weight, with a colour, with both; a colour may have four.
NUMBERS = (3, 4, 6, 7, 8)
# A name may end in a backslash, as folders do: it continues no line.
NAME_LINE = re.compile(rb"[ \t]*(?:mtllib|usemtl|o|g)[ \t]")
CONTINUATION = re.compile(rb"\\[ \t]*\n")
CORNER_BYTES = np.zeros(256, bool)
CORNER_BYTES[list(b"0123456789+-/")] = True


def read(data: bytes, name: str, dtype: np.dtype[Any]) -> Mesh:
    """Vertices of this dtype and triangles."""
    text = text_of(data, name)
    is_vertex = text.same(text.heads, b"v")
    is_face = text.same(text.heads, b"f") | text.same(text.heads, b"fo")
    _check_others(text, text.heads[~(is_vertex | is_face)])
    vertices = vertices_of(text, is_vertex, dtype)
    corners, sizes = corners_of(text, text.heads[is_vertex], is_face)
    return vertices, triangulate(vertices, sizes, corners, name)


def text_of(data: bytes, name: str) -> Text:
    """The statements, without comments, each on one line."""
    data = plain(data, name)
    if b"#" in data:
        data = COMMENT.sub(b"", data)
    return Text(_joined(data) if b"\\" in data else data, name)


def _joined(data: bytes) -> bytes:
    """Join lines that end in a backslash with the next ones."""
    kept, done = [], 0
    for found in CONTINUATION.finditer(data):
        begin = data.rfind(b"\n", 0, found.start()) + 1
        is_name = NAME_LINE.match(data, begin, found.start())
        kept += [data[done : found.start()], b"\n" if is_name else JOINED]
        done = found.end()
    return b"".join([*kept, data[done:]])


def _check_others(text: Text, heads: Ints) -> None:
    """ValueError at a line that is unknown, or that stands for what isn't read."""
    for known in (b"vt", b"vn"):  # as many as vertices: not one by one
        heads = heads[~text.same(heads, known)]
    for head in heads.tolist():
        keyword = text.data[text.starts[head] : text.ends[head]]
        if keyword in REFUSED:
            raise text.error(
                head, f"`{keyword.decode()}`, {REFUSED[keyword]}, is not read: export the mesh as polygons"
            )
        if keyword not in SKIPPED:
            raise text.error(
                head, f"expected a statement of OBJ, got {text.quoted(head)}: comments begin with #"
            )


def vertices_of(text: Text, is_vertex: Bools, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The vertices (v,3)."""
    heads, counts = text.heads[is_vertex], text.counts[is_vertex] - 1
    expected = "expected 3 numbers, 4 with a weight or 6 to 8 with a colour"
    text.check(np.isin(counts, NUMBERS), heads, expected)
    for more in np.unique(counts[counts > 3]):
        text.reals(heads[counts == more, None] + np.arange(4, more + 1), np.dtype(np.float64))
    return text.reals(heads[:, None] + np.arange(1, 4), dtype)


def corners_of(text: Text, vertex_heads: Ints, is_face: Bools) -> tuple[Ints, Ints]:
    """The vertex of each corner of all faces, from 0, and how many corners each face has."""
    heads, sizes = text.heads[is_face], text.counts[is_face] - 1
    text.check(sizes >= 3, heads, "expected a face of at least three corners")
    words = text.ranges(heads + 1, sizes)
    index = text.integers(words, _vertex_ends(text, words))
    # Relative indices count back from the last vertex before their line.
    before = np.repeat(np.searchsorted(vertex_heads, heads), sizes)
    corners = np.where(index > 0, index - 1, before + index)
    wrong = np.flatnonzero((index == 0) | (corners < 0) | (corners >= len(vertex_heads)))
    if wrong.size:
        at = wrong[0]
        found = int(index[at])
        expected = (
            f"an index from -{before[at]}, the first vertex before this line, to -1"
            if found < 0
            else f"an index from 1 to {len(vertex_heads)}, the file's vertices"
        )
        raise text.error(int(words[at]), f"expected {expected}, got {found}")
    return corners, sizes


def _vertex_ends(text: Text, words: Ints) -> Ints:
    """Where the vertex's number ends in corners such as 1, 1/2, 1//3 and 1/2/3."""
    ends = text.ends[words]
    slashes = text.places(b"/")
    if not slashes.size or not words.size:
        return ends
    starts = text.starts[words]
    each = len(slashes) // len(words)
    first, behind = np.arange(len(words)) * each, np.full(len(words), each)
    # As a rule, corners have all slashes, and all as many; else they are looked for.
    if (
        each * len(words) != len(slashes)
        or (slashes[first] < starts).any()
        or (slashes[first + each - 1] >= ends).any()
    ):
        first = np.searchsorted(slashes, starts)
        behind = np.searchsorted(slashes, ends) - first
    has_slash = behind > 0
    rest = slashes[first[has_slash]]
    wrong = behind > 2
    wrong[has_slash] |= ~text.made_of(rest, ends[has_slash], CORNER_BYTES)
    if wrong.any():
        word = int(words[np.argmax(wrong)])
        raise text.error(word, f"expected a corner such as 1, 1/2, 1//3 or 1/2/3, got {text.quoted(word)}")
    ends[has_slash] = rest
    return ends
