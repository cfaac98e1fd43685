"""3MF packages: the triangles of the objects that the build places, in its order.

Read by the standard library alone: trimesh needs two more packages for 3MF, leaves out objects that are not
defined without a word, orders copies by its own graph, and unpacks every member of the archive.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Generic, TypeVar
from urllib.parse import unquote

from wive._internal.archives import Archive
from wive._internal.formats import Mesh
from wive._internal.formats.named import named
from wive._internal.formats.placing import IDENTITY, NOTHING, Counts, Matrix, joined
from wive._internal.formats.threemf.part import Object, Part, Reference
from wive._internal.formats.xml_events import Attributes, Handler, parse

MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
CHUNK = 1 << 16
# A mesh's text packs to a fifth or a tenth of its length. What is long and packs to less than a hundredth is
# made to keep a reader busy.
LONG, MOST_PACKED = 1 << 30, 100
LONGEST_PICTURE = 1 << 28
PartKind = TypeVar("PartKind", bound=Part)


class Package(Generic[PartKind]):
    """The model parts of a 3MF archive, each parsed when it is first used, as this class of parts."""

    def __init__(self, data: bytes, kind: type[PartKind]) -> None:
        """Read the table of contents, and find the part that the package begins with."""
        self._kind = kind
        try:
            self._archive = Archive(io.BytesIO(data))
        except MemoryError:
            raise
        except Exception as error:  # zipfile raises what it likes on damaged bytes
            raise ValueError(
                f"archive: expected a 3MF package ({reason(error)}): the file is damaged"
            ) from None
        self._names = {name.lstrip("/").lower(): name for name in self._archive.names}
        self._parts: dict[str, PartKind] = {}
        self.root = self._root()

    def part(self, path: str, place: str) -> PartKind:
        """The model part at this path of the package, which `place` refers to."""
        name = path.lstrip("/").lower()
        if name not in self._names:
            name = unquote(name)
        if name not in self._names:
            raise ValueError(
                f"{place}: refers to {path!r:.60}, which is not in the package: the file is damaged"
            )
        if name not in self._parts:
            self._parts[name] = self._kind(self._chunks(name), self._names[name])
        return self._parts[name]

    def picture(self, path: str) -> bytes | None:
        """The bytes of another member; None if there is none at this path, if it is damaged or too long."""
        name = path.lstrip("/").lower()
        if name not in self._names or self._archive.size(self._names[name]) > LONGEST_PICTURE:
            return None
        try:
            return b"".join(self._chunks(name))
        except ValueError:
            return None

    def _root(self) -> str:
        if "_rels/.rels" in self._names:
            relations = Relations()
            parse(self._chunks("_rels/.rels"), relations)
            if relations.target is not None:
                return relations.target
        found = [name for name in self._names if name.startswith("3d/") and name.endswith(".model")]
        if "3d/3dmodel.model" in found:
            return "3d/3dmodel.model"
        if len(found) != 1:
            raise ValueError("archive: expected a model part, 3D/3dmodel.model: the file is no 3MF package")
        return found[0]

    def _chunks(self, name: str) -> Iterator[bytes]:
        """The bytes of a member."""
        try:
            stream, size = self._archive.open(self._names[name])
            packed = self._archive.packed_size(self._names[name])
            if size > LONG and size > MOST_PACKED * packed:
                raise ValueError(f"would unpack {packed} bytes to {size}")
            with stream:
                while chunk := stream.read(CHUNK):
                    yield chunk
        except MemoryError:
            raise
        except Exception as error:
            raise ValueError(f"archive: {self._names[name]}: {reason(error)}: the file is damaged") from None


class Relations(Handler):
    """The target of a package's relationship to its model part."""

    target: str | None = None

    def start(self, tag: str, attributes: Attributes) -> None:
        """Note the target."""
        if tag.rpartition(" ")[2] == "Relationship" and attributes.get("Type") == MODEL:
            self.target = self.target or attributes.get("Target")


def read(data: bytes, name: str) -> Mesh:
    """Vertices (v,3), float64, and faces (f,3), of the build's items in order, components of each in order.

    Each copy of an object has its own vertices, all of the object's. Numbers are in the file's unit.
    """
    with named(name):
        copies = placed(Package(data, Part))
        return joined((found.vertices, found.triangles, matrix[None]) for _, found, matrix in copies)


def placed(package: Package[PartKind]) -> Iterator[tuple[PartKind, Object, Matrix]]:
    """Each copy of a mesh that the build places, in order: its part, its object and its matrix."""
    root = package.part(package.root, "_rels/.rels")
    if not root.items:
        raise ValueError(f"{package.root}: build: has no item, so no object is placed")
    counts: dict[int, Counts] = {}  # of an object and its components, by id()
    Counts.of(0, 0, [count(package, package.root, item, counts) for item in root.items]).check()
    stack = [(package.root, item, IDENTITY) for item in reversed(root.items)]
    while stack:
        path, reference, outer = stack.pop()
        path, found = target(package, path, reference)
        if counts[id(found)] is NOTHING:  # nested empty objects may have copies without number
            continue
        matrix = outer if reference.matrix is IDENTITY else outer @ reference.matrix
        if len(found.vertices):
            yield package.part(path, reference.place), found, matrix
        stack += [(path, component, matrix) for component in reversed(found.components)]


def target(package: Package[PartKind], path: str, reference: Reference) -> tuple[str, Object]:
    """The path of the part that holds an object, and the object; `path` is the part that refers to it."""
    path = path if reference.path is None else reference.path
    found = package.part(path, reference.place).objects.get(reference.object)
    if found is None:
        raise ValueError(
            f"{reference.place}: object {reference.object!r:.40} is not defined: the file is damaged"
        )
    if found.shape is not None:
        raise ValueError(
            f"{found.place}: has a {found.shape}, which is not read: export the model as a mesh of triangles"
        )
    return path, found


def count(package: Package[PartKind], path: str, reference: Reference, counts: dict[int, Counts]) -> Counts:
    """What a reference places."""
    stack = [target(package, path, reference)]
    first = stack[0][1]
    entered: set[int] = set()
    while stack:  # no recursion: components may be nested deep
        path, found = stack[-1]
        if id(found) in counts:
            stack.pop()
            continue
        below = [target(package, path, component) for component in found.components]
        missing = {id(one): (path, one) for path, one in below if id(one) not in counts}
        if not missing:
            inner = [counts[id(one)] for _, one in below]
            counts[id(found)] = Counts.of(len(found.vertices), len(found.triangles), inner)
        elif id(found) in entered:
            raise ValueError(f"{found.place}: is a component of itself: the file is damaged")
        else:
            entered.add(id(found))
            stack += missing.values()
    return counts[id(first)]


def reason(error: Exception) -> str:
    """An error's text as part of a line."""
    return " ".join(str(error).split())[:80] or type(error).__name__
