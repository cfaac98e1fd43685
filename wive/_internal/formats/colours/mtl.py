"""Materials of OBJ: the diffuse colours and textures of MTL files."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.beside import beside

# Options of textures, each with how many words it has; numbers behind the first may be missing.
OPTIONS = {
    **{b"-o": 3, b"-s": 3, b"-t": 3, b"-mm": 2},
    **dict.fromkeys((b"-blendu", b"-blendv", b"-bm", b"-boost", b"-cc", b"-clamp"), 1),
    **dict.fromkeys((b"-imfchan", b"-texres", b"-type"), 1),
}


@dataclass
class Material:
    """The diffuse colour of a material, sRGB, and the path of its texture, each None if it has none.

    Places on the texture are multiplied by `scale`, then moved by `shift`.
    """

    colour: tuple[float, ...] | None = None
    texture: str | None = None
    scale: tuple[float, float] = (1.0, 1.0)
    shift: tuple[float, float] = (0.0, 0.0)
    is_clamped: bool = False

    def moved(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places (...,2) of the file, where the material's options put them, from the left and the top."""
        u, v = np.moveaxis(places * self.scale + self.shift, -1, 0)
        return np.stack([u, 1 - v], axis=-1)


def read_materials(names: bytes, folder: str) -> dict[bytes, Material]:
    """The materials by name of a `mtllib`, which is one name with spaces, or several names.

    Files are looked for in this folder and below; what can't be read is left out.
    """
    for each in ([names], names.split()):
        paths = [path for name in each if (path := beside(folder, os.fsdecode(name)))]
        if paths:
            found: dict[bytes, Material] = {}
            for path in paths:
                found |= _read_file(path)
            return found
    return {}


def _read_file(path: str) -> dict[bytes, Material]:
    found: dict[bytes, Material] = {}
    material = Material()
    with open(path, "rb") as file:
        for line in file.read().splitlines():
            keyword, rest = (*line.split(None, 1), b"", b"")[:2]
            if keyword == b"newmtl":
                material = found[rest.strip()] = Material()
            elif keyword == b"Kd":
                with suppress(ValueError):  # a spectrum or a space that is not RGB
                    material.colour = _three(rest.split())
            elif keyword.lower() == b"map_kd":
                with suppress(ValueError):
                    _add_texture(material, rest, os.path.dirname(path))
    return found


def _three(words: list[bytes]) -> tuple[float, ...]:
    numbers = [float(word) for word in words]
    if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
        raise ValueError("expected one or three finite numbers")
    return tuple((numbers * 3)[:3])


def _add_texture(material: Material, rest: bytes, folder: str) -> None:
    """Read what stands behind `map_Kd`: options, then the name of a file, which may have spaces."""
    options: dict[bytes, list[bytes]] = {}
    while len(words := rest.split(None, 1)) == 2 and words[0].lower() in OPTIONS:
        option, rest = words[0].lower(), words[1]
        values = options[option] = []
        while len(values) < OPTIONS[option] and len(words := rest.split(None, 1)) == 2:
            if values and not _is_number(words[0]):
                break
            values.append(words[0])
            rest = words[1]
    if b"-o" in options:
        material.shift = _two(options[b"-o"], 0.0)
    if b"-s" in options:
        material.scale = _two(options[b"-s"], 1.0)
    material.is_clamped = options.get(b"-clamp") == [b"on"]
    material.texture = beside(folder, os.fsdecode(rest.strip()))


def _two(words: list[bytes], default: float) -> tuple[float, float]:
    u, v = [*(float(word) for word in words), default][:2]
    return u, v


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
