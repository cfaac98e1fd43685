"""glTF: the base colour factor of materials, times COLOR_0. Textures are not read."""

from __future__ import annotations

import numpy as np

from wive._internal.formats.colours import Colours
from wive._internal.formats.gltf.accessors import describe, values
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.fields import index_of, members, numbers
from wive._internal.formats.gltf.nodes import Scene
from wive._internal.formats.gltf.reader import Primitive, primitives
from wive._internal.formats.named import named

WHITE = (1.0, 1.0, 1.0)


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3), vertices in the order of the mesh's reader; section 3.9.2: both are linear."""
    with named(name):
        document = Document(data, folder)
        meshes: dict[int, Colours] = {}
        for drawn in (scene := Scene(document)).drawn:
            if drawn.mesh not in meshes:
                found = primitives(document, drawn.mesh, drawn.place)
                meshes[drawn.mesh] = np.concatenate(
                    [np.empty((0, 3)), *(_of_vertices(document, primitive) for primitive in found)]
                )
        parts = [np.tile(meshes[drawn.mesh], (drawn.copies, 1)) for drawn in scene.drawn]
        colours = np.concatenate([np.empty((0, 3)), *parts])
        return None if (colours == WHITE).all() else colours


def _of_vertices(document: Document, primitive: Primitive) -> Colours:
    """(n,3) of a primitive's vertices."""
    count, place = primitive.positions.count, primitive.place
    colours = np.tile(np.array(_factor(document, primitive)), (count, 1))
    index = index_of(members(primitive.fields, "attributes", place), "COLOR_0", place)
    if index is None:
        return colours
    kind = document.item("accessors", index, place).get("type")
    accessor = describe(document, index, f"{place}: COLOR_0", "VEC4" if kind == "VEC4" else "VEC3")
    if accessor.count != count:
        raise ValueError(f"{place}: COLOR_0: expected {count} colours, found {accessor.count}")
    return colours * np.clip(values(document, accessor)[:, :3].astype(np.float64), 0, 1)


def _factor(document: Document, primitive: Primitive) -> tuple[float, ...]:
    index = index_of(primitive.fields, "material", primitive.place)
    if index is None:
        return WHITE
    place = f"materials[{index}]"
    surface = members(document.item("materials", index, primitive.place), "pbrMetallicRoughness", place)
    if "baseColorFactor" not in surface:
        return WHITE
    return tuple(np.clip(numbers(surface, "baseColorFactor", place, 4)[:3], 0, 1).tolist())
