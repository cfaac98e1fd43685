"""The files beside a mesh that belong to it: a picture must not replace a texture."""

import mmap
import os
import re

from wive._internal.files import PathLike, file_name


def names_file(mesh: PathLike, other: PathLike) -> bool:
    """Whether a mesh file, or a material file beside it, has the name of `other` in it."""
    path = file_name(mesh)
    folder = os.path.dirname(path) or "."
    materials = [os.path.join(folder, name) for name in os.listdir(folder) if name.lower().endswith(".mtl")]
    base = re.escape(os.path.basename(file_name(other)).encode(errors="surrogateescape"))
    # The whole name: "room.png" is not in "bedroom.png".
    name = re.compile(rb"(?<![\w.-])" + base + rb"(?![\w.-])", re.IGNORECASE)
    return any(_has(file, name) for file in (path, *materials))


def _has(path: str, name: re.Pattern[bytes]) -> bool:
    if os.path.getsize(path) == 0:  # can't be mapped
        return False
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return name.search(content) is not None
