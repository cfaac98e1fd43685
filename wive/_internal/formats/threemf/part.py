"""A model part of a 3MF package: its objects and what its build places.

https://github.com/3MFConsortium/spec_core, sections 3 and 4; the production extension's paths.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.placing import IDENTITY, Matrix
from wive._internal.formats.xml_events import Attributes, Handler, floats, parse

CORE = re.compile(r"http://schemas\.microsoft\.com/3dmanufacturing/core/\d+/\d+")
# Required extensions that are read, or leave triangles where they are; objects of beams are refused singly.
KNOWN = re.compile(
    r"http://schemas\.(?:microsoft\.com|3mf\.io)/3dmanufacturing/"
    r"(?:core|material|production|trianglesets|beamlattice|slice)(?:/balls)?/\d+/\d+"
)
BATCH = 1 << 15  # words converted at once
PRODUCTION = re.compile(r"http://schemas\.microsoft\.com/3dmanufacturing/production/\d+/\d+ path")


@dataclass(frozen=True)
class Reference:
    """An item of the build or a component: which object of which part (None: this one), and its matrix."""

    place: str
    path: str | None
    object: str
    matrix: Matrix


@dataclass
class Object:
    """A mesh or components. `shape` names what else it has instead of triangles."""

    place: str
    has_mesh: bool = False
    shape: str | None = None
    components: list[Reference] = field(default_factory=list)
    vertices: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    triangles: NDArray[np.int32] = field(default_factory=lambda: np.empty((0, 3), np.int32))


class Rows:
    """Rows of three numbers, converted from words by and by, since words take ten times the memory."""

    def __init__(self) -> None:
        """Begin with no rows."""
        self._words: list[str] = []
        self._numbers = [np.empty(0)]

    def add(self, words: list[str], place: str) -> None:
        """Add a row."""
        self._words += words
        if len(self._words) >= BATCH:
            self._convert(place)

    def take(self, place: str) -> NDArray[np.float64]:
        """All rows (n,3), and begin again."""
        self._convert(place)
        rows = np.concatenate(self._numbers).reshape(-1, 3)
        self._numbers = [np.empty(0)]
        return rows

    def _convert(self, place: str) -> None:
        self._numbers.append(finite(self._words, place))
        self._words = []


def finite(words: list[str], place: str) -> NDArray[np.float64]:
    """The finite numbers that words are."""
    try:
        numbers = floats(words)
    except ValueError as error:
        raise ValueError(f"{place}: {error}: the file is damaged") from None
    if not np.isfinite(numbers).all():
        found = words[int(np.argmin(np.isfinite(numbers)))]
        raise ValueError(f"{place}: expected finite numbers, found {found!r:.40}")
    return numbers


class Part(Handler):
    """The objects of a model part by id, and the items of its build in order."""

    def __init__(self, chunks: Iterable[bytes], place: str) -> None:
        """Parse the part, which errors call `place`."""
        self.objects: dict[str, Object] = {}
        self.items: list[Reference] = []
        self._place = place
        self._here = ""  # the object
        self._open: list[str] = []  # elements
        self._has_model = False
        self._prefixes: dict[str, str] = {}
        self._object = Object("")
        self._vertices, self._triangles = Rows(), Rows()
        self._is_core = {"": True}  # by namespace
        try:
            parse(chunks, self)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from None
        if not self._has_model:
            raise ValueError(f"{place}: expected an element `model` first: the file is no 3MF")

    def namespace(self, prefix: str | None, address: str) -> None:
        """Note what a prefix stands for."""
        self._prefixes[prefix or ""] = address

    def start(self, tag: str, attributes: Attributes) -> None:
        """Note what the element holds."""
        space, _, name = tag.rpartition(" ")
        parent = self._open[-1] if self._open else ""
        is_core = self._is_core.get(space)
        if is_core is None:
            is_core = self._is_core[space] = CORE.fullmatch(space) is not None
        self._open.append(name if is_core else tag)
        if not is_core:
            if parent == "object" or (parent == "mesh" and name in ("beamlattice", "displacementmesh")):
                self._object.shape = name
        elif name == "vertex" and parent == "vertices":
            self._vertices.add(self._values(attributes, "x", "y", "z"), self._here)
        elif name == "triangle" and parent == "triangles":
            self._triangles.add(self._values(attributes, "v1", "v2", "v3"), self._here)
        elif name == "model" and not parent:
            self._has_model = True
            self._check_extensions(attributes.get("requiredextensions", ""))
        elif name == "object" and parent == "resources":
            (key,) = self._values(attributes, "id")
            if key in self.objects:
                raise ValueError(f"line {self.line()}: a second object {key!r:.40}: the file is damaged")
            self._here = f"object {key:.40}"
            self._object = self.objects[key] = Object(f"{self._place}: {self._here}")
        elif name == "mesh" and parent == "object":
            if self._object.has_mesh:
                raise ValueError(f"{self._here}: has a second mesh: the file is damaged")
            self._object.has_mesh = True
        elif name == "component" and parent == "components":
            self._object.components.append(self._reference(attributes, "component"))
        elif name == "item" and parent == "build":
            self.items.append(self._reference(attributes, f"item {len(self.items)}"))

    def end(self, tag: str) -> None:
        """Finish an object's mesh."""
        if self._open.pop() == "mesh" and self._open and self._open[-1] == "object":
            points, corners = self._vertices.take(self._here), self._triangles.take(self._here)
            wrong = ~((corners >= 0) & (corners < len(points)) & (corners % 1 == 0)).all(axis=1)
            if wrong.any():
                row = int(np.argmax(wrong))
                found = " ".join(f"{corner:.15g}" for corner in corners[row].tolist())
                raise ValueError(
                    f"{self._here}: triangle {row}: expected indices below {len(points)}, found {found}: "
                    "the file is damaged"
                )
            self._object.vertices, self._object.triangles = points, corners.astype(np.int32)

    def _values(self, attributes: Attributes, *keys: str) -> list[str]:
        try:
            return [attributes[key] for key in keys]
        except KeyError as error:
            element = self._open[-1]
            raise ValueError(
                f"line {self.line()}: {element}: expected an attribute {error}: the file is damaged"
            ) from None

    def _reference(self, attributes: Attributes, what: str) -> Reference:
        here = f"line {self.line()}: {what}"
        (key,) = self._values(attributes, "objectid")
        matrix = IDENTITY
        if "transform" in attributes:
            numbers = finite(attributes["transform"].split(), f"{here}: transform")
            if len(numbers) != 12:
                raise ValueError(f"{here}: transform: expected 12 numbers, found {len(numbers)}")
            matrix = np.eye(4)
            matrix[:3] = numbers.reshape(4, 3).T  # of row vectors
        path = next((value for name, value in attributes.items() if PRODUCTION.fullmatch(name)), None)
        return Reference(f"{self._place}: {here}", path, key, matrix)

    def _check_extensions(self, prefixes: str) -> None:
        for prefix in prefixes.split():
            address = self._prefixes.get(prefix, prefix)
            if not KNOWN.fullmatch(address):
                raise ValueError(
                    f"model: requires the extension {address!r:.100}, which is not read: export the "
                    "model without it, or as PLY, GLB or STL"
                )
