"""OBJ: colours behind the coordinates of vertices, else the diffuse colours of materials."""

from __future__ import annotations

import os
from contextlib import suppress

import numpy as np

from wive._internal.formats.colours import Colours, linear, linear_guessed, of_triangles
from wive._internal.formats.obj import text_of
from wive._internal.formats.text import Text


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3); all are sRGB. Material files are looked for in the mesh's folder and below it."""
    text = text_of(data, name)
    is_vertex = text.same(text.heads, b"v")
    heads, counts = text.heads[is_vertex], text.counts[is_vertex] - 1
    if len(heads) and (counts == 6).all():
        return linear_guessed(text.reals(heads[:, None] + np.arange(4, 7), np.dtype(np.float64)))
    is_use = text.same(text.heads, b"usemtl")
    is_face = text.same(text.heads, b"f") | text.same(text.heads, b"fo")
    uses, faces = text.heads[is_use], text.heads[is_face]
    if folder is None or not len(uses):
        return None
    materials: dict[bytes, tuple[float, ...]] = {}
    for head in text.heads[text.same(text.heads, b"mtllib")].tolist():
        for path in _paths(_rest(text, head), folder):
            materials |= _diffuse(path)
    named = [materials.get(_rest(text, head)) for head in uses.tolist()]
    colours = np.array([(np.nan,) * 3, *(found or (np.nan,) * 3 for found in named)])
    if not materials or np.isnan(colours).all():
        return None
    polygons = linear(colours[np.searchsorted(uses, faces)], 1)
    return of_triangles(polygons, text.counts[is_face] - 1)


def _rest(text: Text, head: int) -> bytes:
    """What stands behind the first word of a line."""
    start = int(text.ends[head])
    return text.data[start : text.data.index(b"\n", start)].strip()


def _paths(names: bytes, folder: str) -> list[str]:
    """The material files of a `mtllib`, which are one name with spaces, or several names."""
    for found in ([names], names.split()):
        parts = [os.fsdecode(each).replace("\\", "/") for each in found]
        paths = [os.path.join(folder, part) for part in parts if _is_below(part)]
        paths = [path for path in paths if os.path.isfile(path)]
        if paths:
            return paths
    return []


def _is_below(part: str) -> bool:
    """Whether a path stays in its folder."""
    return not (part.startswith("/") or ":" in part or "\0" in part or ".." in part.split("/"))


def _diffuse(path: str) -> dict[bytes, tuple[float, ...]]:
    """The diffuse colour of each material of an MTL file; those without a readable one are left out."""
    found: dict[bytes, tuple[float, ...]] = {}
    name = b""
    with open(path, "rb") as file:
        for line in file.read().splitlines():
            words = line.split()
            if words[:1] == [b"newmtl"]:
                name = line.split(None, 1)[1].strip() if len(words) > 1 else b""
            elif words[:1] == [b"Kd"] and len(words) in (2, 4):
                with suppress(ValueError):  # a spectrum or a space that is not RGB
                    numbers = [float(word) for word in words[1:]]
                    if all(map(np.isfinite, numbers)):
                        found[name] = tuple((numbers * 3)[:3])
    return found
