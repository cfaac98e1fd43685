"""3MF: display colours of base materials and of their mixtures, colours of colour groups, textures."""

from __future__ import annotations

import re

import numpy as np

from wive._internal.formats.colours import Colours, linear
from wive._internal.formats.colours.corners import Painted, of_copies
from wive._internal.formats.colours.texture import Textures
from wive._internal.formats.colours.texture_mean import Means
from wive._internal.formats.colours.threemf_part import ColouredPart, Group
from wive._internal.formats.named import named
from wive._internal.formats.threemf.part import Object
from wive._internal.formats.threemf.reader import Package, placed

INDEX = re.compile(r"[0-9]{1,9}")


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3), in the order of the mesh's reader; all are sRGB. Other kinds of groups have none."""
    with named(name):
        package = Package(data, ColouredPart)
        painter = Painter(package)
        meshes: dict[int, Painted] = {}
        copies = []
        for part, found, _ in placed(package):
            if id(found) not in meshes:
                meshes[id(found)] = painter.painted(part, found)
            copies.append(meshes[id(found)])
        return of_copies(copies)


class Painter:
    """Colours of the objects of a package."""

    def __init__(self, package: Package[ColouredPart]) -> None:
        """Read no texture yet."""
        self._package = package
        self._textures, self._means = Textures(), Means()

    def painted(self, part: ColouredPart, found: Object) -> Painted:
        """The mesh of an object, with its colours."""
        surface = part.surface(found)
        colours = np.full((len(surface.rows), 3, 3), np.nan)
        on_textures: dict[str, tuple[list[int], list[list[tuple[float, ...]]]]] = {}
        for row, properties in enumerate(surface.rows):
            key, indices = surface.corners(properties)
            group = part.groups.get(key or "", Group())
            if not group.members:  # a group of another kind, or none
                continue
            corners = _picked(group, indices, f"{found.place}: group {key!r:.40}")
            if group.mixed is not None:
                colours[row] = _mixtures(part, group.mixed, corners, f"{found.place}: group {key!r:.40}")
            elif group.texture is None:
                colours[row] = linear(np.array(corners), 255)
            else:
                rows, places = on_textures.setdefault(group.texture, ([], []))
                rows.append(row)
                places.append(corners)
        for texture, (rows, places) in on_textures.items():
            colours[rows] = self._of_texture(part, texture, np.array(places))[:, None]
        which = np.array(surface.of_triangles, np.int32)
        return Painted(len(found.vertices), found.triangles, colours[which])

    def _of_texture(self, part: ColouredPart, key: str, places: Colours) -> Colours:
        """The means (n,3) of a texture over triangles of these places (n,3,2); NaN if it can't be read."""
        texture = part.textures.get(key)
        path = "" if texture is None else texture.path
        texels = self._textures.get(path, lambda: self._package.picture(path))
        if texels is None or texture is None:
            return np.full((len(places), 3), np.nan)
        places[..., 1] = 1 - places[..., 1]  # images begin at their top
        return self._means.over(texels, places, texture.wrap)


def _mixtures(
    part: ColouredPart, mixed: tuple[str, tuple[str, ...]], proportions: list[tuple[float, ...]], place: str
) -> Colours:
    """(n,3) linear colours of mixtures of base materials; NaN if a material in it has no colour.

    As spec_materials says, section 4.1: proportions are relative to their sum; those left out are 0, those
    too many don't count, and if all are 0 the materials have equal parts.
    """
    key, indices = mixed
    materials = part.groups.get(key, Group())
    if not materials.members or materials.texture is not None or materials.mixed is not None:
        return np.full((len(proportions), 3), np.nan)
    colours = linear(np.array(_picked(materials, indices, place)).reshape(-1, 3), 255)
    parts = np.zeros((len(proportions), len(indices)))
    for row, given in zip(parts, proportions, strict=True):
        known = given[: len(indices)]
        if not all(0 <= value <= 1 for value in known):
            raise ValueError(
                f"{place}: expected proportions from 0 to 1, found {' '.join(map(str, known))!r:.40}: "
                "the file is damaged"
            )
        row[: len(known)] = known
        row[:] = row / row.sum() if row.any() else 1 / max(len(row), 1)
    return np.asarray(np.where(parts[..., None] > 0, parts[..., None] * colours, 0).sum(axis=1))


def _picked(group: Group, indices: tuple[str | None, ...], place: str) -> list[tuple[float, ...]]:
    """The members of a group that corners have."""
    found = []
    for index in indices:
        number = index or ""
        if not (INDEX.fullmatch(number) and int(number) < len(group.members)):
            raise ValueError(
                f"{place}: expected an index below {len(group.members)}, found {index!r:.40}: "
                "the file is damaged"
            )
        found.append(group.members[int(number)])
    return found
