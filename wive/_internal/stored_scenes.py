"""Trees that lie in a file or in shared memory: opened once per process, and pickled by their place."""

from __future__ import annotations

import errno
import mmap
import os
import weakref
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal import shared_memory
from wive._internal.files import PathLike, atomic_write
from wive._internal.lines import one_line
from wive._internal.npzfile import check_input
from wive._internal.process_lock import PROCESS_LOCK
from wive._internal.progress import ProgressOption, progress_of
from wive._internal.storage import Options
from wive._internal.tree_file import MAGIC, Content, content_of, image_of, is_image, tree_of
from wive.geoms import Geoms

# Bytes that are written at once.
CHUNK = 1 << 24


class Place(NamedTuple):
    """Where a tree lies: in the file, or in the shared memory, of that name, if the digest is its own."""

    kind: Literal["file", "shared memory"]
    name: str
    digest: str

    @property
    def described(self) -> str:
        """Where that is, in one line."""
        how = "wive.load" if self.kind == "file" else self.kind
        return f"{how}({one_line(self.name)!r})"

    def open(self) -> _cpu.Bvh:
        """The tree, if not yet held: OSError if it is not there, ValueError if it has changed."""
        held = _held.get(self)
        if held is not None:
            return held
        try:
            bvh = open_file(self.name) if self.kind == "file" else open_shared(self.name)
        except FileNotFoundError:
            raise FileNotFoundError(f"{one_line(self.name)}: {_GONE[self.kind]}") from None
        if source_of(bvh).place.digest != self.digest:
            raise ValueError(
                f"{one_line(self.name)}: has changed since the scene was pickled: load it and pickle it again"
            )
        return bvh


_GONE = {
    "file": "no such file, and the scene that was pickled is in it: put the file back, or pickle again",
    "shared memory": "no such shared memory: the process that shared the scene must keep it while it is used",
}


class Source:
    """What a stored tree came with; `Bvh.source`, which the tree keeps alive."""

    def __init__(self, place: Place, content: Content, owner: object = None) -> None:
        """Keep the parts; `owner` frees shared memory when it goes."""
        self.place, self.vertices, self.faces = place, content.vertices, content.faces
        self.geoms: Geoms | None = content.geoms
        self.options: Options = content.options
        self._owner = owner


# The trees that this process holds.
_held: weakref.WeakValueDictionary[Place, _cpu.Bvh] = weakref.WeakValueDictionary()


def source_of(bvh: _cpu.Bvh) -> Source:
    """The source of a stored tree."""
    source = bvh.source
    assert isinstance(source, Source)
    return source


def is_stored_file(path: PathLike) -> bool:
    """Whether `save_file` wrote this file; OSError if it can't be read."""
    with open(check_input(path), "rb") as file:
        return is_image(file.read(len(MAGIC)))


def save_file(
    path: PathLike,
    bvh: _cpu.Bvh,
    faces: NDArray[np.int32],
    geoms: Geoms | None,
    options: Options,
    progress: ProgressOption = None,
) -> None:
    """Write the tree, its mesh and its options; the file is whole or as it was."""
    image = image_of(bvh, faces, geoms, options)
    with progress_of(progress, image.size, "B", "saving") as asked, atomic_write(path) as file:
        for piece in image.pieces():
            for begin in range(0, len(piece), CHUNK):
                file.write(piece[begin : begin + CHUNK])
                if asked is not None:
                    asked.at(file.tell() / image.size)


def open_file(path: PathLike) -> _cpu.Bvh:
    """The tree in a file, mapped read-only. Raises OSError, or ValueError that names the file."""
    name = check_input(path)
    shown = one_line(name)
    with open(name, "rb") as file:
        if os.fstat(file.fileno()).st_size == 0:
            raise ValueError(f"{shown}: is empty")
        try:
            memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except OSError as error:
            if error.errno == errno.ENOMEM:
                raise MemoryError(f"{shown}: not enough address space to map it") from None
            raise OSError(error.errno, f"can't be mapped: {error.strerror}", name) from error
    return _opened(memory, "file", os.path.abspath(name), shown, None)


def open_shared(name: str) -> _cpu.Bvh:
    """The tree in the shared memory of that name."""
    for reference in _held.valuerefs():  # a list: other threads may open trees and let go of them meanwhile
        bvh = reference()
        if bvh is not None and source_of(bvh).place[:2] == ("shared memory", name):
            return bvh
    return _opened(shared_memory.attach(name), "shared memory", name, f"shared memory {name}", None)


def share(bvh: _cpu.Bvh, faces: NDArray[np.int32], geoms: Geoms | None, options: Options) -> _cpu.Bvh:
    """The same tree in new shared memory, which is freed when this process lets go of the tree or ends."""
    image = image_of(bvh, faces, geoms, options)
    owner = shared_memory.create(image.size, image.pieces())
    memory = shared_memory.attach(owner.name)
    return _opened(memory, "shared memory", owner.name, f"shared memory {owner.name}", owner)


def _opened(
    memory: Any, kind: Literal["file", "shared memory"], name: str, shown: str, owner: object
) -> _cpu.Bvh:
    content = content_of(memory, shown, is_rounded=kind == "shared memory")
    place = Place(kind, name, content.digest)
    held = _held.get(place)
    if held is not None:
        return held
    bvh = tree_of(content, shown, Source(place, content, owner))
    with PROCESS_LOCK:  # of threads that open the tree at once, all get the first one's
        return _held.setdefault(place, bvh)
