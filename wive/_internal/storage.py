"""A scene as one file: its mesh and its options. Loading builds the tree again, bit for bit the same."""

from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

from wive._internal.files import PathLike, atomic_write
from wive._internal.npzfile import open_npz
from wive._internal.precision import Floats

FORMAT = "wive scene"
FORMAT_VERSION = 1


class Options(TypedDict):
    """The options of `wive.Scene` as the user gave them."""

    backend: str
    device: str | None
    accuracy: Literal["fast", "watertight", "exact"]
    nodes: Literal["float32", "compressed"]
    quality: Literal["medium", "high"]


def write_scene(path: PathLike, vertices: Floats, faces: NDArray[np.int32], options: Options) -> None:
    """Write the file, in NumPy's npz format, vertices in their dtype, which is the scene's precision.

    An interrupted or failed write leaves nothing behind.
    """
    import json

    header = json.dumps({"format": FORMAT, "version": FORMAT_VERSION, "options": options})
    with atomic_write(path) as file:
        np.savez(file, header=np.array(header), vertices=vertices, faces=faces)


def read_scene(path: PathLike) -> tuple[Floats, NDArray[np.int32], Options]:
    """Read what `write_scene` wrote.

    Raises OSError if the file can't be read, ValueError if it is no scene or of a newer version.
    """
    import json

    with open_npz(path, "a scene saved by wive") as found:
        if not {"header", "vertices", "faces"} <= found.keys():
            raise ValueError(f"{path}: not a scene saved by wive")
        arrays = {name: found[name] for name in ("header", "vertices", "faces")}
    try:
        header = json.loads(str(arrays["header"]))
        is_scene, version = header["format"] == FORMAT, header["version"]
        given = header["options"]
        options = Options(
            backend=given["backend"],
            device=given.get("device"),
            accuracy=given["accuracy"],
            nodes=given["nodes"],
            quality=given.get("quality", "medium"),
        )
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        is_scene = False
    if not is_scene:
        raise ValueError(f"{path}: not a scene saved by wive")
    if version != FORMAT_VERSION:
        raise ValueError(f"{path}: scene file of version {version}, this wive reads version {FORMAT_VERSION}")
    return arrays["vertices"], arrays["faces"], options
