"""COLLADA: colours of vertices and corners, times the diffuse colours or textures of effects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.colours import Colours, linear
from wive._internal.formats.colours.corners import Painted, of_copies
from wive._internal.formats.colours.dae_effects import Surface, surface_of
from wive._internal.formats.colours.texture import Textures
from wive._internal.formats.colours.texture_mean import Means
from wive._internal.formats.dae.geometry import Piece, picked, pieces
from wive._internal.formats.dae.reader import Copy, Scene
from wive._internal.formats.dae.tree import Document, Element
from wive._internal.formats.named import named

WHAT = {"COLOR": "colours", "TEXCOORD": "places on a texture"}


class Binding(NamedTuple):
    """What an instance of a geometry binds to a symbol: a material, and sets of its texture coordinates."""

    symbol: str
    target: str
    sets: tuple[tuple[str, str], ...]


class Painter:
    """Colours of the geometries of a document."""

    def __init__(self, document: Document, name: str, folder: str | None) -> None:
        """Read nothing yet."""
        self._document, self._name, self._folder = document, name, folder
        self._textures, self._means = Textures(), Means()
        self._surfaces: dict[str, Surface] = {}

    def painted(self, one: Copy, bindings: tuple[Binding, ...]) -> Painted:
        """A geometry in the materials that an instance binds."""
        bound = {binding.symbol: binding for binding in bindings}
        colours = [np.empty((0, 3, 3))]
        for piece in pieces(self._document, one.geometry, self._name):
            binding = bound.get(piece.primitive.attributes.get("material", ""), Binding("", "", ()))
            material = self._of_material(piece, binding)
            corners = self._of_corners(piece, "COLOR", "RGB")
            if corners is None:
                corners = np.broadcast_to(material[:, None], (*piece.corners.shape, 3))
            else:
                is_plain = np.isnan(material).any(axis=1, keepdims=True)
                corners = linear(corners, 1) * np.where(is_plain, 1, material)[:, None]
            colours.append(corners)
        return Painted(len(one.shape.vertices), one.shape.triangles, np.concatenate(colours))

    def _of_material(self, piece: Piece, binding: Binding) -> Colours:
        """(f,3) of a piece's triangles; NaN without a material, or with a texture that can't be read."""
        if binding.target not in self._surfaces:
            self._surfaces[binding.target] = surface_of(self._document, binding.target, self._folder)
        surface = self._surfaces[binding.target]
        colours = np.broadcast_to(surface.colour, (len(piece.corners), 3))
        texels = self._textures.get(surface.path, lambda: surface.path or None)
        if texels is None:
            return colours
        wanted = dict(binding.sets).get(surface.coordinates)
        places = self._of_corners(piece, "TEXCOORD", "ST", wanted)
        if places is None:
            return colours
        up = np.stack([places[..., 0], 1 - places[..., 1]], axis=-1)  # images begin at their top
        return self._means.over(texels, up, surface.wrap)

    def _of_corners(
        self, piece: Piece, semantic: str, axes: str, wanted: str | None = None
    ) -> NDArray[np.float64] | None:
        """Numbers (f,3,k) of the corners of a piece, by its own inputs, else by those of its vertices.

        They are those of the input with the set `wanted`, else of the first with this semantic.
        """
        of_rows = [(one, one.whole("offset")) for one in piece.primitive.all("input")]
        of_vertices = [(one, piece.column) for one in piece.mesh.one("vertices").all("input")]
        inputs = [each for each in of_rows + of_vertices if each[0].attributes.get("semantic") == semantic]
        if not inputs:
            return None
        one, column = next((each for each in inputs if each[0].attributes.get("set") == wanted), inputs[0])
        numbers = picked(self._document, one, axes, WHAT[semantic])
        which = piece.rows[piece.corners, column]
        if which.max(initial=-1) >= len(numbers):
            raise ValueError(
                f"{piece.primitive.place}: has the index {which.max()} for {len(numbers)} {WHAT[semantic]}: "
                "the file is damaged"
            )
        found: NDArray[np.float64] = numbers[which]
        return found


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3), in the order of the mesh's reader; all are sRGB."""
    with named(name):
        scene = Scene(Document(data), name)
        painter = Painter(scene.document, name, folder)
        meshes: dict[tuple[int, tuple[Binding, ...]], Painted] = {}
        copies = []
        for one in scene.placed():
            key = id(one.geometry), _bound(one.instance)
            if key not in meshes:
                meshes[key] = painter.painted(one, key[1])
            copies.append(meshes[key])
        return of_copies(copies)


def _bound(instance: Element) -> tuple[Binding, ...]:
    """The materials that an instance of a geometry binds to its symbols."""
    return tuple(
        Binding(
            one.attributes.get("symbol", ""),
            one.attributes.get("target", ""),
            tuple(
                (each.attributes.get("semantic", ""), each.attributes.get("input_set", "0"))
                for each in one.all("bind_vertex_input")
            ),
        )
        for binding in instance.all("bind_material")
        for technique in binding.all("technique_common")
        for one in technique.all("instance_material")
    )
