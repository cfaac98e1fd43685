"""Model parts of 3MF with their groups of colours and of places on textures, and what uses them.

https://github.com/3MFConsortium/spec_core, sections 4.1.4 and 5; spec_materials, chapters 2 to 4 and 6.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from wive._internal.formats.colours.texture_mean import CLAMP, MIRROR, REPEAT
from wive._internal.formats.threemf.part import Object, Part, finite
from wive._internal.formats.xml_events import Attributes

MATERIAL = re.compile(r"http://schemas\.microsoft\.com/3dmanufacturing/material/\d+/\d+ (\w+)")
# Elements of groups, and those of their members.
GROUPS = {
    "basematerials": "base",
    "colorgroup": "color",
    "texture2dgroup": "tex2coord",
    "compositematerials": "composite",
}
COLOUR = re.compile(r"#([0-9a-fA-F]{6})(?:[0-9a-fA-F]{2})?")
WRAPS = {"wrap": REPEAT, "mirror": MIRROR, "clamp": CLAMP, "none": CLAMP}
NONE = (np.nan,) * 3
# Attributes of a triangle: its group, and which of the group's members its corners have.
Properties = tuple[str | None, str | None, str | None, str | None]


@dataclass(frozen=True)
class Texture:
    """A texture's path in the package, and what is beyond its sides."""

    path: str
    wrap: tuple[str, str]


@dataclass
class Group:
    """Colours from 0 to 255; places on a texture from its left and bottom, if it has the texture's id; or the
    proportions of base materials, if it has the group of these and which of its members they are.
    """

    texture: str | None = None
    mixed: tuple[str, tuple[str, ...]] | None = None
    members: list[tuple[float, ...]] = field(default_factory=list)


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
        """The group of a triangle, and which of its members the corners have."""
        group, first, second, third = properties
        if first is None:
            return self.group, (self.index,) * 3
        if second is None or third is None:
            second = third = first
        return (self.group if group is None else group), (first, second, third)


class ColouredPart(Part):
    """A model part with its groups, its textures, and the properties of its objects."""

    def __init__(self, chunks: Iterable[bytes], place: str) -> None:
        """Parse the part, which errors call `place`."""
        self.groups: dict[str, Group] = {}
        self.textures: dict[str, Texture] = {}
        self._surfaces: dict[int, Surface] = {}  # by id() of objects
        self._surface, self._group = Surface({}), Group()
        super().__init__(chunks, place)

    def start(self, tag: str, attributes: Attributes) -> None:
        """Note colours, places and properties as well."""
        super().start(tag, attributes)
        *_, parent, name = ("", *self._open[-2:])
        if name == "triangle" and parent == "triangles":
            self._surface.add(attributes)
            return
        parent, name = _local(parent), _local(name)
        if parent == "resources":
            if name == "object":
                self._surface = self._surfaces[id(self._object)] = Surface(attributes)
            elif name in GROUPS:
                (key,) = self._values(attributes, "id")
                mixed = None
                if name == "compositematerials":
                    base, materials = self._values(attributes, "matid", "matindices")
                    mixed = base, tuple(materials.split())
                self._group = self.groups.setdefault(key, Group(attributes.get("texid"), mixed))
            elif name == "texture2d":
                key, path = self._values(attributes, "id", "path")
                styles = [attributes.get(key, "wrap") for key in ("tilestyleu", "tilestylev")]
                self.textures[key] = Texture(path, (_wrap(styles[0]), _wrap(styles[1])))
        elif name == GROUPS.get(parent):
            self._group.members.append(self._member(name, attributes))

    def surface(self, found: Object) -> Surface:
        """The properties of an object of this part."""
        surface = self._surfaces[id(found)]
        if len(surface.of_triangles) != len(found.triangles):
            raise ValueError(f"{found.place}: has triangles outside its mesh: the file is damaged")
        return surface

    def _member(self, name: str, attributes: Attributes) -> tuple[float, ...]:
        if name == "composite":
            here = f"line {self.line()}: {name}"
            return tuple(finite(self._values(attributes, "values")[0].split(), here).tolist())
        if name == "tex2coord":
            here = f"line {self.line()}: {name}"
            u, v = finite(self._values(attributes, "u", "v"), here).tolist()
            return u, v
        key = "displaycolor" if name == "base" else "color"
        if key not in attributes:
            return NONE
        found = COLOUR.fullmatch(attributes[key].strip())
        if not found:
            raise ValueError(
                f"line {self.line()}: {name}: {key}: expected #RRGGBB or #RRGGBBAA, "
                f"found {attributes[key]!r:.40}"
            )
        return tuple(bytes.fromhex(found[1]))


def _local(name: str) -> str:
    """An element's name without the namespace of materials."""
    found = MATERIAL.fullmatch(name)
    return found[1] if found else name


def _wrap(style: str) -> str:
    return WRAPS.get(style, REPEAT)
