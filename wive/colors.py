"""Colours of mesh files, for pictures."""

from __future__ import annotations

from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.kinds import kind_of
from wive._internal.room import room_for
from wive.meshfile import MeshSource, content_of

READERS = {
    **{kind: kind for kind in ("ply", "off", "obj", "stl", "dae", "gltf")},
    **{"glb": "gltf", "vrm": "gltf", "3mf": "threemf"},
}
# What the whitest surfaces of a file reflect, as white paint does; and those that it gives no colour.
WHITE, UNKNOWN = 0.8, 0.6


def load_colors(source: MeshSource, *, file_type: str | None = None) -> NDArray[np.float32] | None:
    """The colours in a mesh file, as `wive.render` takes them for `albedo`; None if there are none.

    PLY and OFF: of vertices or faces. OBJ: of vertices, else diffuse colours and textures of materials. glTF
    and COLLADA: base or diffuse colours and textures, times vertex colours. 3MF: base materials, colour
    groups and textures. Binary STL: of facets. Pillow reads textures, which give each triangle their mean;
    one that can't be read leaves the material's colour. docs/mesh_files.md has the rules.

    Arguments:
        source, file_type: as `load_mesh` takes them.

    Returns (v,3) float32 of vertices, or (f,1,3) of triangles, in the order of `load_mesh`: linear
    reflectances from 0 to 0.8, which is white; 0.6 for what the file gives no colour. Raises what
    `load_mesh` raises.

    >>> picture = wive.render(wive.Scene.from_file(path), albedo=wive.load_colors(path))
    """
    name, folder, data = content_of(source)
    kind = kind_of(data, name, file_type)
    if kind not in READERS:
        return None
    with room_for(name):
        colours = import_module(f"wive._internal.formats.colours.{READERS[kind]}").read(data, name, folder)
    if colours is None:
        return None
    is_unknown = np.isnan(colours).any(axis=-1, keepdims=True)
    reflected = np.where(is_unknown, UNKNOWN, WHITE * colours)
    return np.clip(reflected, 0, WHITE).astype(np.float32)
