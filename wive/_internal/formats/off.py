"""OFF, also with colours, normals or texture coordinates: text, one vertex or face per line."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from wive._internal.formats import Mesh
from wive._internal.formats.text import COMMENT, Text, plain, quoted
from wive._internal.formats.triangulate import triangulate

# ModelNet's files have no space behind OFF.
HEADER = re.compile(rb"\s*((?:ST)?C?N?(4?)(n?)OFF)(?=[\s\d]|\Z)[ \t]*(BINARY\b)?")


def read(data: bytes, name: str, dtype: np.dtype[Any]) -> Mesh:
    """Vertices of this dtype and triangles."""
    header = HEADER.match(data[:1000]) if b"BINARY" in data[:1000] else None
    if header and header[4]:
        raise ValueError(f"{name}: line 1: binary OFF is not read: save the mesh as text, or as PLY")
    data = COMMENT.sub(b"", plain(data, name))
    header = HEADER.match(data)
    if not header:
        found = quoted(data[:1000].lstrip().partition(b"\n")[0])
        raise Text(data, name).error(0, f"expected a header such as OFF, COFF or NOFF, got {found}")
    if header[2] or header[3]:
        raise ValueError(
            f"{name}: line 1: {header[1].decode()} has vertices of other than three coordinates: "
            "only meshes of three dimensions are read"
        )
    text = Text(data[header.end() :], name, data.count(b"\n", 0, header.end()))
    if not text.heads.size or text.counts[0] not in (2, 3):
        found = text.quoted(0) if text.heads.size else "the file's end"
        expected = "expected the number of vertices, of faces and, maybe, of edges"
        raise text.error(0, f"{expected}, got {found}")
    vertex_count, face_count, *_ = text.integers(np.arange(text.counts[0])).tolist()
    if vertex_count < 0 or face_count < 0 or vertex_count + face_count != len(text.heads) - 1:
        raise text.error(
            0,
            f"the header has {vertex_count:,} vertices and {face_count:,} faces, a line each, "
            f"and {len(text.heads) - 1:,} lines follow: the file is cut short or damaged",
        )
    heads, counts = text.heads[1:], text.counts[1:]
    text.check(counts[:vertex_count] >= 3, heads, "expected a vertex of three numbers")
    vertices = text.reals(heads[:vertex_count, None] + np.arange(3), dtype)
    heads, counts = heads[vertex_count:], counts[vertex_count:]
    sizes = text.integers(heads)
    text.check(sizes >= 3, heads, "expected a face of at least three corners")
    # What follows the corners is the face's colour.
    text.check(sizes < counts, heads, "expected as many corners as the line's first number says")
    words = text.ranges(heads + 1, sizes)
    corners = text.integers(words)
    expected = f"expected an index from 0 to {vertex_count - 1}, the file's vertices"
    text.check((corners >= 0) & (corners < vertex_count), words, expected)
    return vertices, triangulate(vertices, sizes, corners, name)
