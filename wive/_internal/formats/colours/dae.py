"""COLLADA: colours of vertices and corners, times the diffuse colours of effects.

https://www.khronos.org/files/collada_spec_1_4.pdf, chapters 5 (inputs COLOR) and 8 (profile_COMMON).
"""

from __future__ import annotations

import numpy as np

from wive._internal.formats.colours import Colours, linear
from wive._internal.formats.colours.corners import Painted, of_copies
from wive._internal.formats.dae.geometry import Piece, picked, pieces
from wive._internal.formats.dae.reader import Copy, Scene
from wive._internal.formats.dae.tree import Document, Element
from wive._internal.formats.named import named

# Shaders, and what each shows in white light.
SHADERS = {"lambert": "diffuse", "phong": "diffuse", "blinn": "diffuse", "constant": "emission"}
NUMBERS = "float3", "float4"
NONE = np.full(3, np.nan)


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3), in the order of the mesh's reader; all are sRGB. Textures have none."""
    with named(name):
        scene = Scene(Document(data), name)
        meshes: dict[tuple[int, tuple[tuple[str, str], ...]], Painted] = {}
        copies = []
        for one in scene.placed():
            materials = _bound(one.instance)
            key = id(one.geometry), tuple(sorted(materials.items()))
            if key not in meshes:
                meshes[key] = _painted(scene.document, one, materials, name)
            copies.append(meshes[key])
        return of_copies(copies)


def _bound(instance: Element) -> dict[str, str]:
    """The materials that an instance of a geometry binds to its symbols."""
    return {
        one.attributes.get("symbol", ""): one.attributes.get("target", "")
        for binding in instance.all("bind_material")
        for technique in binding.all("technique_common")
        for one in technique.all("instance_material")
    }


def _painted(document: Document, one: Copy, materials: dict[str, str], name: str) -> Painted:
    colours = [np.empty((0, 3, 3))]
    for piece in pieces(document, one.geometry, name):
        address = materials.get(piece.primitive.attributes.get("material", ""), "")
        material, corners = _diffuse(document, address), _of_corners(document, piece)
        if corners is None:
            corners = np.broadcast_to(material, (*piece.corners.shape, 3))
        elif not np.isnan(material).any():
            corners = corners * material
        colours.append(corners)
    return Painted(len(one.shape.vertices), one.shape.triangles, np.concatenate(colours))


def _of_corners(document: Document, piece: Piece) -> Colours | None:
    """(f,3,3) of the first input COLOR of a piece, or of the vertices that it lists."""
    of_rows = [(one, one.whole("offset")) for one in piece.primitive.all("input")]
    of_vertices = [(one, piece.column) for one in piece.mesh.one("vertices").all("input")]
    inputs = [each for each in of_rows + of_vertices if each[0].attributes.get("semantic") == "COLOR"]
    if not inputs:
        return None
    (one, column), *_ = inputs
    colours = picked(document, one, "RGB", "A")
    which = piece.rows[piece.corners, column]
    if which.max(initial=-1) >= len(colours):
        raise ValueError(
            f"{piece.primitive.place}: has the index {which.max()} of a colour, expected at most "
            f"{len(colours) - 1}: the file is damaged"
        )
    found: Colours = linear(colours, 1)[which]
    return found


def _diffuse(document: Document, address: str) -> Colours:
    """The colour (3,) of a material; NaN if it is in another file, has a texture or none."""
    material = document.find(address)
    instance = None if material is None else material.first("instance_effect")
    effect = None if instance is None else document.find(instance.attributes.get("url", ""))
    profile = None if effect is None else effect.first("profile_COMMON")
    technique = None if profile is None else profile.first("technique")
    if effect is None or profile is None or technique is None:
        return NONE
    for shader in technique.all(*SHADERS):
        for shown in shader.all(SHADERS[shader.tag]):
            for one in (*shown.all("color"), *_parameters(shown, profile, effect)):
                numbers = one.numbers()
                if len(numbers) not in (3, 4):
                    raise ValueError(
                        f"{one.place}: expected 3 or 4 numbers, found {len(numbers)}: the file is damaged"
                    )
                return linear(numbers[:3], 1)
    return NONE


def _parameters(shown: Element, *holders: Element) -> list[Element]:
    """The numbers of the parameter that a colour refers to."""
    wanted = {one.attributes.get("ref") for one in shown.all("param")}
    return [
        numbers
        for holder in holders
        for one in holder.all("newparam")
        if one.attributes.get("sid", "") in wanted
        for numbers in one.all(*NUMBERS)
    ]
