"""glTF: the base colour factor of materials, times COLOR_0, times the base colour texture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wive._internal.formats.colours import Colours
from wive._internal.formats.colours.gltf_textures import BaseTextures
from wive._internal.formats.gltf.accessors import describe, values
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.fields import index_of, members, numbers
from wive._internal.formats.gltf.nodes import Scene
from wive._internal.formats.gltf.reader import Primitive, primitives, triangles
from wive._internal.formats.named import named

WHITE = (1.0, 1.0, 1.0)


class Coloured(NamedTuple):
    """A mesh with the colours (v,3) of its vertices, and those (f,3) of its triangles if it has textures."""

    primitives: list[Primitive]
    vertices: Colours
    textures: list[Colours | None]  # of each primitive's triangles

    def of_triangles(self, document: Document) -> Colours:
        """(f,1,3): the means of the vertices, times those of textures."""
        parts, start = [np.empty((0, 3))], 0
        for primitive, texture in zip(self.primitives, self.textures, strict=True):
            corners = start + triangles(document, primitive)
            colours = self.vertices[corners].mean(axis=1)
            parts.append(colours if texture is None else colours * np.where(np.isnan(texture), 1, texture))
            start += primitive.positions.count
        return np.concatenate(parts)[:, None]


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3), or (f,1,3) if there are textures, in the order of the mesh's reader.

    Section 3.9.2: the factor and COLOR_0 are linear, textures are sRGB.
    """
    with named(name):
        document = Document(data, folder)
        textures = BaseTextures(document)
        meshes: dict[int, Coloured] = {}
        for drawn in (scene := Scene(document)).drawn:
            if drawn.mesh not in meshes:
                found = list(primitives(document, drawn.mesh, drawn.place))
                meshes[drawn.mesh] = Coloured(
                    found,
                    np.concatenate([np.empty((0, 3)), *(_of_vertices(document, one) for one in found)]),
                    [textures.means(one) for one in found],
                )
        parts = {key: mesh.vertices for key, mesh in meshes.items()}
        if any(texture is not None for mesh in meshes.values() for texture in mesh.textures):
            parts = {key: mesh.of_triangles(document) for key, mesh in meshes.items()}
        elif all((colours == WHITE).all() for colours in parts.values()):
            return None
        copies = [np.concatenate([parts[drawn.mesh]] * drawn.copies) for drawn in scene.drawn if drawn.copies]
        return np.concatenate(copies) if copies else None


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
