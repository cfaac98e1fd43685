"""3MF: display colours of base materials, and colours of colour groups.

https://github.com/3MFConsortium/spec_core, sections 4.1.4 and 5; spec_materials, section 2.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable

import numpy as np

from wive._internal.formats.colours import Colours, linear
from wive._internal.formats.colours.corners import Painted, of_copies
from wive._internal.formats.named import named
from wive._internal.formats.threemf.part import Object, Part
from wive._internal.formats.threemf.reader import Package, placed
from wive._internal.formats.xml_events import Attributes

MATERIAL = re.compile(r"http://schemas\.microsoft\.com/3dmanufacturing/material/\d+/\d+ (\w+)")
# Elements of groups, and of their colours; the attribute that is the colour.
GROUPS = {"basematerials": ("base", "displaycolor"), "colorgroup": ("color", "color")}
COLOUR = re.compile(r"#([0-9a-fA-F]{6})(?:[0-9a-fA-F]{2})?")
INDEX = re.compile(r"[0-9]{1,9}")
NONE = (np.nan,) * 3
# Attributes of a triangle: its group, and which of the group's colours its corners have.
Properties = tuple[str | None, str | None, str | None, str | None]


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3), in the order of the mesh's reader; all are sRGB. Other kinds of groups have none."""
    with named(name):
        meshes: dict[int, Painted] = {}
        copies = []
        for part, found, _ in placed(Package(data, ColouredPart)):
            if id(found) not in meshes:
                meshes[id(found)] = part.painted(found)
            copies.append(meshes[id(found)])
        return of_copies(copies)


class Surface:
    """The properties of an object and of its triangles, which mostly share few."""

    def __init__(self, attributes: Attributes) -> None:
        """Begin with no triangles; properties of an object are those of triangles without."""
        self.group, self.index = attributes.get("pid"), attributes.get("pindex")
        self.rows: dict[Properties, int] = {}
        self.of_triangles = array("i")

    def add(self, attributes: Attributes) -> None:
        """Add a triangle."""
        get = attributes.get
        properties = get("pid"), get("p1"), get("p2"), get("p3")
        self.of_triangles.append(self.rows.setdefault(properties, len(self.rows)))

    def corners(self, properties: Properties) -> tuple[str | None, tuple[str | None, ...]]:
        """The group of a triangle, and which of its colours the corners have."""
        group, first, second, third = properties
        if first is None:
            return self.group, (self.index,) * 3
        if second is None or third is None:
            second = third = first
        return (self.group if group is None else group), (first, second, third)


class ColouredPart(Part):
    """A model part with its groups of colours, and the properties of its objects."""

    def __init__(self, chunks: Iterable[bytes], place: str) -> None:
        """Parse the part, which errors call `place`."""
        self._groups: dict[str, list[tuple[float, ...]]] = {}
        self._surfaces: dict[int, Surface] = {}  # by id() of objects
        self._surface = Surface({})
        self._colours: list[tuple[float, ...]] = []
        super().__init__(chunks, place)

    def start(self, tag: str, attributes: Attributes) -> None:
        """Note colours and properties as well."""
        super().start(tag, attributes)
        *_, parent, name = ("", *self._open[-2:])
        if name == "triangle" and parent == "triangles":
            self._surface.add(attributes)
        elif name == "object" and parent == "resources":
            self._surface = self._surfaces[id(self._object)] = Surface(attributes)
        elif _local(name) in GROUPS and parent == "resources":
            (key,) = self._values(attributes, "id")
            self._colours = self._groups.setdefault(key, [])
        elif _local(parent) in GROUPS:
            element, attribute = GROUPS[_local(parent)]
            if _local(name) == element:
                self._colours.append(self._colour(attributes.get(attribute), f"{element}: {attribute}"))

    def painted(self, found: Object) -> Painted:
        """The mesh of an object, with its colours."""
        surface = self._surfaces[id(found)]
        rows = [self._of_corners(surface, properties, found.place) for properties in surface.rows]
        colours = linear(np.array(rows).reshape(-1, 3, 3), 255)
        which = np.array(surface.of_triangles, np.int32)
        if len(which) != len(found.triangles):
            raise ValueError(f"{found.place}: has triangles outside its mesh: the file is damaged")
        return Painted(len(found.vertices), found.triangles, colours[which])

    def _of_corners(self, surface: Surface, properties: Properties, place: str) -> list[tuple[float, ...]]:
        group, indices = surface.corners(properties)
        colours = self._groups.get(group or "", [])
        if not colours:  # a group of another kind, or none
            return [NONE] * 3
        found = []
        for index in indices:
            number = index or ""
            if not (
                number.isascii() and number.isdigit() and len(number) < 10 and int(number) < len(colours)
            ):
                raise ValueError(
                    f"{place}: expected an index below {len(colours)}, the colours of group {group!r:.40}, "
                    f"found {index!r:.40}: the file is damaged"
                )
            found.append(colours[int(number)])
        return found

    def _colour(self, text: str | None, what: str) -> tuple[float, ...]:
        """Red, green and blue from 0 to 255."""
        if text is None:
            return NONE
        found = COLOUR.fullmatch(text.strip())
        if not found:
            raise ValueError(f"line {self.line()}: {what}: expected #RRGGBB or #RRGGBBAA, found {text!r:.40}")
        return tuple(bytes.fromhex(found[1]))


def _local(name: str) -> str:
    """An element's name without the namespace of materials."""
    found = MATERIAL.fullmatch(name)
    return found[1] if found else name
