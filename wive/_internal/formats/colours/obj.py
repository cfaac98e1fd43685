"""OBJ: colours behind the coordinates of vertices, else the diffuse colours and textures of materials."""

from __future__ import annotations

import numpy as np

from wive._internal.formats.colours import Colours, linear, linear_guessed
from wive._internal.formats.colours.mtl import Material, read_materials
from wive._internal.formats.colours.obj_textures import places_of
from wive._internal.formats.colours.texture import Texels, Textures
from wive._internal.formats.colours.texture_mean import CLAMP, REPEAT, Means
from wive._internal.formats.obj import text_of
from wive._internal.formats.text import Bools, Ints, Text


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3); all are sRGB. Other files are looked for in the mesh's folder and below it."""
    text = text_of(data, name)
    is_vertex = text.same(text.heads, b"v")
    heads, counts = text.heads[is_vertex], text.counts[is_vertex] - 1
    if len(heads) and (counts == 6).all():
        return linear_guessed(text.reals(heads[:, None] + np.arange(4, 7), np.dtype(np.float64)))
    is_use = text.same(text.heads, b"usemtl")
    is_face = text.same(text.heads, b"f") | text.same(text.heads, b"fo")
    uses = text.heads[is_use]
    if folder is None or not len(uses):
        return None
    known: dict[bytes, Material] = {}
    for head in text.heads[text.same(text.heads, b"mtllib")].tolist():
        known |= read_materials(_rest(text, head), folder)
    # Materials by number, of which 0 is none; the number of each use, and of each triangle.
    materials = [Material(), *known.values()]
    number = {key: at for at, key in enumerate(known, start=1)}
    of_uses = np.array([0, *(number.get(_rest(text, head), 0) for head in uses.tolist())])
    of_faces = of_uses[np.searchsorted(uses, text.heads[is_face])]
    used = np.repeat(of_faces, np.maximum(text.counts[is_face] - 3, 0))
    plain = linear(np.array([one.colour or (np.nan,) * 3 for one in materials]), 1)
    colours: Colours = plain[used][:, None]
    _add_textures(colours, text, is_vertex, is_face, materials, used)
    return None if np.isnan(colours).all() else colours


def _add_textures(
    colours: Colours, text: Text, is_vertex: Bools, is_face: Bools, materials: list[Material], used: Ints
) -> None:
    """Multiply the colours (f,1,3) of triangles that have textures which can be read by these."""
    textures, means, places = Textures(), Means(), None
    order = np.argsort(used, kind="stable")
    for which in np.split(order, np.flatnonzero(np.diff(used[order])) + 1) if len(order) else ():
        one = materials[used[which[0]]]
        texels = _texels(textures, one.texture)
        if texels is None:
            continue
        places = places_of(text, is_vertex, is_face) if places is None else places
        moved = one.moved(places[which])
        found = means.over(texels, moved, (CLAMP, CLAMP) if one.is_clamped else (REPEAT, REPEAT))
        if one.colour is None:
            colours[which, 0] = found
        else:
            colours[which, 0] *= np.where(np.isnan(found), 1, found)


def _texels(textures: Textures, path: str | None) -> Texels | None:
    return None if path is None else textures.get(path, lambda: path)


def _rest(text: Text, head: int) -> bytes:
    """What stands behind the first word of a line."""
    start = int(text.ends[head])
    return text.data[start : text.data.index(b"\n", start)].strip()
