"""The colours of surfaces in a picture."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wive._internal import arguments
from wive._internal.formats.colours import linear
from wive._internal.host_arrays import host_array
from wive._internal.interpolation import interpolated
from wive._internal.picture import Image
from wive._internal.precision import Floats
from wive.hits import Hits
from wive.scene import Scene

GRAY = 0.6


class Albedo(NamedTuple):
    """What part of the light a surface reflects; `colours` are (f,3) or (v,3), as `kind` says."""

    kind: Literal["none", "gray", "normals", "faces", "vertices"]
    colours: Image | None = None

    def at(self, hits: Hits, normals: Floats) -> Floats | float:
        """(n,3) colours, or one number, at hits that all hit something, with these normals."""
        if self.kind == "normals":
            return np.asarray(normals * 0.5 + 0.5)
        if self.kind == "faces" and self.colours is not None:
            return self.colours[hits.prim]
        if self.kind == "vertices" and self.colours is not None:
            return interpolated(self.colours, hits.faces, hits.prim, hits.uv)
        return GRAY if self.kind == "gray" else 1.0


def albedo_of(value: ArrayLike | None, scene: Scene) -> Albedo:
    """The argument `albedo`, checked; None is "none"."""
    if value is None:
        return Albedo("none")
    if isinstance(value, str):
        return Albedo("normals" if value == "normals" else "gray")
    faces, vertices = len(scene), len(scene.vertices)
    array = arguments.nan_if_masked(arguments.array_of_numbers("albedo", host_array("albedo", value)))
    if array.dtype == np.uint8 and array.ndim and array.shape[-1] in (3, 4):  # as trimesh and files have them
        array = linear(array[..., :3], 255)
    elif array.dtype.kind != "f":
        raise TypeError(
            "albedo must be floats from 0 to 1, linear, or uint8 from 0 to 255, sRGB, "
            f"got dtype {array.dtype}"
        )
    if array.shape == (3,):
        array = np.broadcast_to(array, (faces, 1, 3))
    if array.shape not in ((vertices, 3), (faces, 3), (faces, 1, 3)):
        raise ValueError(
            "albedo must be one of gray, normals, or colours of shape "
            f"(3,), ({vertices}, 3), one per vertex, or ({faces}, 3), one per triangle, got {array.shape}"
        )
    kind: Literal["faces", "vertices"] = "vertices" if array.shape == (vertices, 3) else "faces"
    colours: Image = np.ascontiguousarray(array.reshape(-1, 3), np.float32)
    wrong = ~((colours >= 0) & (colours <= 1)).all(axis=1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(f"albedo must be from 0 to 1, got {colours[row].tolist()} in row {row}")
    return Albedo(kind, colours)
