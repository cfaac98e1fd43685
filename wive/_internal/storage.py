"""A scene as one file: its mesh and its options. Loading builds the tree again, bit for bit the same."""

import io
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from wive._internal.arguments import AccuracyOption, NodesOption, QualityOption
from wive._internal.files import PathLike, atomic_write, file_name
from wive._internal.lines import one_line
from wive._internal.npzfile import Npz, open_npz
from wive._internal.precision import Floats
from wive._internal.room import room_for

FORMAT = "wive scene"
FORMAT_VERSION = 1


class Options(TypedDict):
    """The options of `wive.Scene` as the user gave them."""

    backend: str
    device: str | None
    accuracy: AccuracyOption
    nodes: NodesOption
    quality: QualityOption


# What else a file or a pickle may hold is a newer wive's.
OPTIONS = frozenset(Options.__annotations__)
# The arrays of a saved scene's file.
HEADER, MESH = "header", ("vertices", "faces")
ZIP = b"PK\x03\x04"


def write_scene(path: PathLike, vertices: Floats, faces: NDArray[np.int32], options: Options) -> None:
    """Write the file, in NumPy's npz format, vertices in their dtype, which is the scene's precision.

    An interrupted or failed write leaves nothing behind.
    """
    import json

    import wive

    header = json.dumps(
        {"format": FORMAT, "version": FORMAT_VERSION, "wive": wive.__version__, "options": options}
    )
    with atomic_write(path) as file:
        np.savez(file, header=np.array(header), vertices=vertices, faces=faces)


def read_scene(path: PathLike) -> tuple[Floats, NDArray[np.int32], Options]:
    """Read what `write_scene` wrote.

    Raises OSError if the file can't be read, ValueError if it is no scene or of a newer version.
    """
    name = one_line(file_name(path))
    no_scene = f"{name}: not a scene saved by wive"
    with room_for(name), open_npz(path, "a scene saved by wive") as found:
        header = _header(found[HEADER]) if HEADER in found else None
        if header is None:
            raise ValueError(no_scene)
        _refuse_newer_file(name, header)
        given: Any = header.get("options")
        try:
            options = Options(
                backend=given["backend"],
                device=given.get("device"),
                accuracy=given["accuracy"],
                nodes=given["nodes"],
                quality=given.get("quality", "medium"),
            )
            vertices, faces = (found[name] for name in MESH)
        except (KeyError, TypeError):  # options that are no dict are a TypeError
            raise ValueError(no_scene) from None
    return vertices, faces, options


def refuse_newer(what: str, version: int, options: object, writer: object = None) -> None:
    """Raise ValueError if `what` is of a version, or has options, that only a newer wive knows.

    writer: the version of wive that wrote it, if that is known.
    """
    import wive

    unknown = ", ".join(sorted(map(str, options.keys() - OPTIONS))) if isinstance(options, dict) else ""
    if version <= FORMAT_VERSION and not unknown:
        return
    is_newer = version > FORMAT_VERSION
    found = f"of version {version!s:.40}" if is_newer else f"with unknown options ({one_line(unknown):.100})"
    by = f"wive {one_line(writer):.40}" if isinstance(writer, str) else "a newer wive"
    raise ValueError(
        f"{what} {found}, written by {by}; this is wive {wive.__version__}, "
        f"which reads version {FORMAT_VERSION}: upgrade wive, or save the scene again with this one"
    )


def refuse_saved_scene(name: str, data: bytes) -> None:
    """Raise ValueError if the content of a file is a saved scene, where a mesh is expected."""
    if not data.startswith(ZIP):
        return
    try:
        header = _header(Npz(io.BytesIO(data), name, "a scene saved by wive")[HEADER])
    except (KeyError, ValueError):  # another archive, or damaged: the reader of meshes says so
        return
    if header is not None:
        _refuse_newer_file(name, header)
        raise ValueError(
            f"{name}: is a scene that Scene.save wrote and no mesh: open it with wive.load(path)"
        )


def _header(array: NDArray[Any]) -> dict[str, Any] | None:
    """The header of a saved scene, with a version; None if it is none."""
    import json

    try:
        header = json.loads(str(array))
    except (ValueError, RecursionError):
        return None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        return None
    version = header.get("version")
    return header if type(version) is int and version >= 1 else None


def _refuse_newer_file(name: str, header: dict[str, Any]) -> None:
    refuse_newer(f"{name}: scene file", header["version"], header.get("options"), header.get("wive"))
