"""Texture coordinates of OBJ, per corner of the triangles that the mesh's reader makes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.obj import corners_of, vertices_of
from wive._internal.formats.text import Bools, Ints, Text
from wive._internal.formats.triangulate import triangulate

MOST_NUMBERS = 3  # u v w


def places_of(text: Text, is_vertex: Bools, is_face: Bools) -> NDArray[np.float64]:
    """Places (f,3,2) on the texture from its left and its bottom; NaN for corners without."""
    vertices = vertices_of(text, is_vertex, np.dtype(np.float64))
    corners, sizes = corners_of(text, text.heads[is_vertex], is_face)
    triangles = triangulate(vertices[corners], sizes, np.arange(len(corners)), text.name)
    places = np.concatenate([_listed(text), [[np.nan, np.nan]]])
    found: NDArray[np.float64] = places[_of_corners(text, is_face, len(places) - 1)[triangles]]
    return found


def _listed(text: Text) -> NDArray[np.float64]:
    """The `vt` statements (n,2)."""
    is_place = text.same(text.heads, b"vt")
    heads, counts = text.heads[is_place], text.counts[is_place] - 1
    text.check((counts >= 1) & (counts <= MOST_NUMBERS), heads, "expected 1 to 3 numbers")
    has_v = counts > 1
    v = np.zeros(len(heads))
    v[has_v] = text.reals(heads[has_v] + 2, np.dtype(np.float64))
    return np.stack([text.reals(heads + 1, np.dtype(np.float64)), v], axis=1)


def _of_corners(text: Text, is_face: Bools, count: int) -> Ints:
    """Which of the `count` statements each corner has, `count` if it has none of them."""
    heads, sizes = text.heads[is_face], text.counts[is_face] - 1
    words = text.ranges(heads + 1, sizes)
    slashes = text.places(b"/")
    first = np.searchsorted(slashes, text.starts[words])
    behind = np.searchsorted(slashes, text.ends[words]) - first
    slashes = np.append(slashes, [0, 0])  # for corners without
    starts = slashes[first] + 1
    ends = np.where(behind > 1, slashes[first + 1], text.ends[words])
    given = np.flatnonzero((behind > 0) & (ends > starts))
    index = text.integers(words[given], ends[given], starts[given])
    # Relative indices count back from the last statement before their line.
    before = np.searchsorted(text.heads[text.same(text.heads, b"vt")], heads)
    index = np.where(index > 0, index - 1, np.repeat(before, sizes)[given] + index)
    found = np.full(len(words), count)
    is_known = (index >= 0) & (index < count)
    found[given[is_known]] = index[is_known]
    return found
