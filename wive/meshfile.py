"""Meshes from files: the reader is chosen by the file's kind, what it returns is checked once for all."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wive._internal.files import PathLike, named_error
from wive._internal.formats import Mesh
from wive._internal.formats.kinds import compression_of, kind_of
from wive._internal.formats.unread import unread
from wive._internal.lines import one_line
from wive._internal.npzfile import check_input
from wive._internal.precision import FLOAT32, Floats, Real, real_named
from wive._internal.room import room_for
from wive._internal.storage import is_saved_scene
from wive._internal.tree_file import is_image

# Readers of formats that may be text.
TEXT = ("obj", "off", "ply", "stl")
# Modules of other readers.
OTHERS = {"npz": "npz", "3mf": "threemf.reader", "dae": "dae.reader"}
GLTF = ("gltf", "glb", "vrm")
# Vertices and triangles are numbered by int32.
MOST = 2**31 - 1
LONGEST_NAME = 4096


class Readable(Protocol):
    """A file object: an open file or io.BytesIO."""

    def read(self) -> bytes | str:
        """Everything from where it stands to its end."""


MeshSource = PathLike | bytes | bytearray | memoryview | Readable


def load_mesh(
    source: MeshSource, dtype: DTypeLike = np.float32, *, file_type: str | None = None
) -> tuple[Floats, NDArray[np.int32]]:
    """Vertices (v,3) and faces (f,3) of a mesh file, in the file's own order, nothing merged or dropped.

    Triangle i is the file's i-th; a polygon of n corners is n - 2 triangles at its place. docs/mesh_files.md
    lists the formats, what is kept of them and what is refused.

    Arguments:
        source: a path, or the file's content: bytes or a file object, which is read to its end.
        dtype: of the vertices, np.float32 or np.float64. Few files hold more than float32; those of survey
            coordinates do, and a float64 `Scene` keeps it.
        file_type: the format, such as "ply", in place of the extension. Content without a name shows its
            format by its first bytes if this is None.

    Raises OSError if the file can't be read, ValueError if it is no mesh, is damaged or has no triangles,
    ImportError if its format needs a package that is missing, MemoryError if it does not fit into memory.
    Each message is one line that names the file.
    """
    real = real_named(dtype)
    name, folder, data = content_of(source)
    if is_image(data):
        raise _no_mesh(name)
    kind = kind_of(data, name, file_type)
    if not data:
        raise ValueError(f"{name}: is empty")
    if packed := compression_of(data):
        raise unread(name, packed)
    with room_for(name):
        if is_saved_scene(name, io.BytesIO(data)):
            raise _no_mesh(name)
        return _checked(_read(kind, data, name, folder, real), name, real)


def named_mesh(name: str) -> bool:
    """Whether the name is that of a mesh by its extension; .npz, which saved scenes may have, is none."""
    return os.path.splitext(name)[1].lower().lstrip(".") in {*TEXT, *OTHERS, *GLTF} - {"npz"}


def _no_mesh(name: str) -> ValueError:
    return ValueError(f"{name}: is a scene that Scene.save wrote and no mesh: open it with wive.load(path)")


def content_of(source: MeshSource) -> tuple[str, str | None, bytes]:
    """Name for errors, folder if the file has one, content."""
    if isinstance(source, str | os.PathLike):
        path = check_input(source)
        name = one_line(path)
        with room_for(name), open(path, "rb") as file:
            return name, os.path.dirname(os.path.abspath(path)), file.read()
    if isinstance(source, bytes) and len(source) < LONGEST_NAME and os.path.isfile(source):
        raise ValueError(
            f"mesh (bytes): is the name of a file, not its content: pass {os.fsdecode(source)!r}"
        )
    if isinstance(source, bytes | bytearray | memoryview):
        return "mesh (bytes)", None, bytes(source)
    if not callable(getattr(source, "read", None)):
        raise TypeError(f"source must be a path, bytes or a file object, got {type(source).__name__}")
    named = getattr(source, "name", None)  # a number if the file was opened by its descriptor
    name = one_line(named) if isinstance(named, str) and named else "mesh (file object)"
    data = _read_to_end(source, name)
    if not isinstance(data, bytes | bytearray | memoryview):
        raise TypeError(f"source.read() must return bytes, got {type(data).__name__}")
    return name, None, bytes(data)


def _read_to_end(source: Readable, name: str) -> object:
    """What `source.read` returns, text as bytes; OSError or ValueError that names the file if it fails."""
    try:
        data = source.read()
        return data.encode(errors="surrogateescape") if isinstance(data, str) else data
    except MemoryError:
        raise
    except UnicodeError:
        raise ValueError(f"{name}: is opened as text, but is binary: open it with mode 'rb'") from None
    except OSError as error:
        raise named_error(error, name) from error
    except Exception as error:  # of decompressors, archives and closed files
        reason = one_line(str(error)) or type(error).__name__
        raise ValueError(f"{name}: can't be read: {reason:.120}") from error


def _read(kind: str, data: bytes, name: str, folder: str | None, real: Real) -> Mesh:
    """Import the reader of this kind and run it."""
    if kind in GLTF:
        from wive._internal.formats.gltf import reader as gltf

        return gltf.read(data, name, folder)
    if kind in OTHERS:
        reader = import_module(f"wive._internal.formats.{OTHERS[kind]}")
        plain: Callable[[bytes, str], Mesh] = reader.read
        return plain(data, name)
    if kind in TEXT:
        reader = import_module(f"wive._internal.formats.{kind}")
        read: Callable[[bytes, str, np.dtype[Any]], Mesh] = reader.read
        return read(data, name, real.dtype)
    raise unread(name, kind)


def _checked(mesh: Mesh, name: str, real: Real) -> tuple[Floats, NDArray[np.int32]]:
    """The mesh in the dtypes of a scene; ValueError unless it is one."""
    vertices, faces = mesh
    for what, array, kinds in (("vertices", vertices, "iuf"), ("faces", faces, "iu")):
        if array.dtype.kind not in kinds:
            numbers = "real numbers" if what == "vertices" else "integers"
            raise ValueError(f"{name}: {what} must be {numbers}, got dtype {array.dtype}")
        if array.shape[:1] != (0,) and array.shape[1:] != (3,):
            raise ValueError(f"{name}: {what} must have three columns, got shape {array.shape}")
        if len(array) > MOST:
            raise ValueError(f"{name}: has {len(array):,} {what}, more than {MOST:,}: split the file")
    if faces.size == 0:
        raise ValueError(f"{name}: has no triangles")
    wrong = ((faces < 0) | (faces >= len(vertices))).any(axis=1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(
            f"{name}: triangle {row} must index the {len(vertices)} vertices from 0, "
            f"got {faces[row].tolist()}"
        )
    points = real.array(vertices)
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    finite = np.logical_and.reduce(np.isfinite(points), axis=1)
    if not finite.all():  # vertices that no triangle uses may be anything
        row = int(np.argmin(finite[faces].all(axis=1)))
        vertex = min(faces[row].tolist(), key=finite.__getitem__)
        if not finite[vertex]:
            found = np.asarray(vertices[vertex]).tolist()
            is_too_large = real is FLOAT32 and not np.isnan(points[vertex]).any()
            mend = ": if the file has larger numbers, load it with dtype=np.float64" if is_too_large else ""
            expected = f"vertex {vertex} of triangle {row} must be finite {real.name} numbers"
            raise ValueError(f"{name}: {expected}, got {found}{mend}")
    return points, faces
