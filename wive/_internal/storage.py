"""A scene as an npz file: its mesh and its options. Loading builds the tree again, bit for bit the same."""

from typing import IO, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from wive._internal.files import PathLike, atomic_write, file_name
from wive._internal.lines import one_line
from wive._internal.npzfile import Npz, open_npz
from wive._internal.options import AccuracyOption, NodesOption, QualityOption
from wive._internal.precision import Floats
from wive._internal.room import room_for
from wive.geoms import Geoms

FORMAT = "wive scene"
FORMAT_VERSION = 1


class Options(TypedDict):
    """The options of `wive.Scene` as the user gave them."""

    backend: str
    device: str | None
    accuracy: AccuracyOption
    nodes: NodesOption
    quality: QualityOption


# Among the options of a scene of several meshes, so that wives that know one mesh alone refuse it; in a file
# the number of meshes, and the name of the array of their offsets; in a pickle these offsets.
GEOMS = "geoms"
# What else a file or a pickle may hold is a newer wive's.
OPTIONS = frozenset(Options.__annotations__) | {GEOMS}
# The arrays of a saved scene's file.
HEADER, MESH = "header", ("vertices", "faces")
ZIP = b"PK\x03\x04"
OPEN_MESH = "wive.Scene.from_file reads meshes"


def write_scene(
    path: PathLike, vertices: Floats, faces: NDArray[np.int32], geoms: Geoms | None, options: Options
) -> None:
    """Write the file, in NumPy's npz format, vertices in their dtype, which is the scene's precision.

    An interrupted or failed write leaves nothing behind.
    """
    import json

    import wive

    arrays: dict[str, Any] = {"vertices": vertices, "faces": faces}
    saved: dict[str, Any] = {**options}
    if geoms is not None:
        arrays[GEOMS], saved[GEOMS] = geom_offsets(geoms), len(geoms)
    header = json.dumps(
        {"format": FORMAT, "version": FORMAT_VERSION, "wive": wive.__version__, "options": saved}
    )
    with atomic_write(path) as file:
        np.savez(file, header=np.array(header), **arrays)


def geom_offsets(geoms: Geoms) -> NDArray[np.int32]:
    """(2,g+1), the first triangle and the first vertex of each mesh, and how many there are."""
    return np.stack([geoms.faces, geoms.vertices])


def geoms_of_offsets(offsets: NDArray[Any], faces: int, vertices: int) -> Geoms:
    """The meshes of a scene of so many faces and vertices; ValueError if the offsets are not theirs."""
    is_table = offsets.ndim == 2 and len(offsets) == 2 and offsets.dtype == np.int32 and offsets.size > 0
    if (
        not is_table
        or offsets[:, 0].any()
        or (offsets[:, 1:] < offsets[:, :-1]).any()
        or offsets[:, -1].tolist() != [faces, vertices]
    ):
        raise ValueError(f"offsets of meshes must ascend from 0 to {faces} and {vertices}")
    return Geoms(offsets[0].copy(), offsets[1].copy())


def read_scene(path: PathLike) -> tuple[Floats, NDArray[np.int32], Geoms | None, Options]:
    """Read what `write_scene` wrote.

    Raises OSError if the file can't be read, ValueError if it is no scene or of a newer version.
    """
    name = one_line(file_name(path))
    no_scene = f"{name}: not a scene saved by wive"
    with room_for(name), open_npz(path, "a scene saved by wive") as found:
        header = _header(found[HEADER]) if HEADER in found else None
        if header is None:
            is_mesh = HEADER not in found and all(name in found for name in MESH)
            raise ValueError(f"{no_scene}, but a mesh: {OPEN_MESH}" if is_mesh else no_scene)
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
            offsets = found[GEOMS] if GEOMS in given else None
        except (KeyError, TypeError):  # options that are no dict are a TypeError
            raise ValueError(no_scene) from None
    if offsets is None:
        return vertices, faces, None, options
    try:
        geoms = geoms_of_offsets(offsets, len(faces), len(vertices))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{no_scene}: {error}") from None
    return vertices, faces, geoms, options


def refuse_newer(
    what: str, version: int, options: object, writer: object = None, known: int = FORMAT_VERSION
) -> None:
    """Raise ValueError if `what` is of a version, or has options, that only a newer wive knows.

    writer: the version of wive that wrote it, if that is known. known: the latest that this one reads.
    """
    import wive

    unknown = ", ".join(sorted(map(str, options.keys() - OPTIONS))) if isinstance(options, dict) else ""
    if version <= known and not unknown:
        return
    is_newer = version > known
    found = f"of version {version!s:.40}" if is_newer else f"with unknown options ({one_line(unknown):.100})"
    by = f"wive {one_line(writer):.40}" if isinstance(writer, str) else "a newer wive"
    raise ValueError(
        f"{what} {found}, written by {by}; this is wive {wive.__version__}, "
        f"which reads version {known}: upgrade wive, or save the scene again with this one"
    )


def is_saved_scene(name: str, file: IO[bytes]) -> bool:
    """Whether an open file is a saved scene in NumPy's format; ValueError if it is of a newer version."""
    is_zip = file.read(len(ZIP)) == ZIP
    file.seek(0)
    if not is_zip:
        return False
    try:
        header = _header(Npz(file, name, "a scene saved by wive")[HEADER])
    except (KeyError, ValueError):  # another archive, or damaged: the reader of meshes says so
        return False
    if header is not None:
        _refuse_newer_file(name, header)
    return header is not None


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
