"""OFF: colours of vertices (COFF), else those behind the corners of faces."""

from __future__ import annotations

import numpy as np

from wive._internal.formats.colours import Colours, linear_guessed, of_triangles
from wive._internal.formats.off import HEADER
from wive._internal.formats.text import COMMENT, Text, plain


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3); numbers are sRGB, from 0 to 255, or from 0 to 1 if none is larger."""
    data = COMMENT.sub(b"", plain(data, name))
    header = HEADER.match(data)
    if not header:  # the mesh's reader says so
        return None
    text = Text(data[header.end() :], name, data.count(b"\n", 0, header.end()))
    vertex_count, *_ = text.integers(np.arange(text.counts[0])).tolist()
    heads, counts = text.heads[1:], text.counts[1:]
    kind = header[1].decode()
    first = 3 + 3 * ("N" in kind)
    if "C" in kind and vertex_count and (counts[:vertex_count] >= first + 3).all():
        words = heads[:vertex_count, None] + np.arange(first, first + 3)
        return linear_guessed(text.reals(words, np.dtype(np.float64)))
    heads, counts = heads[vertex_count:], counts[vertex_count:]
    sizes = text.integers(heads)
    coloured = counts - 1 - sizes >= 3
    if not coloured.any():
        return None
    polygons = np.full((len(heads), 3), np.nan)
    words = (heads + 1 + sizes)[coloured, None] + np.arange(3)
    polygons[coloured] = linear_guessed(text.reals(words, np.dtype(np.float64)))
    return of_triangles(polygons, sizes)
