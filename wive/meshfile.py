"""Meshes from files: npz files of two arrays, and whatever trimesh reads."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wive._internal.files import PathLike
from wive._internal.npzfile import check_input, read_npz
from wive._internal.precision import real_named


def load_mesh(
    path: PathLike, dtype: DTypeLike = np.float32
) -> tuple[NDArray[np.floating[Any]], NDArray[np.integer[Any]]]:
    """Vertices (v,3) and faces (f,3) of a mesh file, in the file's own order, nothing merged or dropped.

    An .npz file gives its arrays `vertices` and `faces`. Any other file is read by trimesh; the meshes of a
    file that holds a scene are placed and joined.

    Arguments:
        dtype: of the vertices, np.float32 or np.float64. Few files hold more than float32; those of survey
            coordinates do, and a float64 `Scene` keeps it.

    Raises OSError if the file can't be read, ValueError if it is no mesh or has no triangles, ImportError if
    trimesh is missing. Each message is one line that names the file.
    """
    real = real_named(dtype)
    name = check_input(path)
    if name.lower().endswith(".npz"):
        arrays = read_npz(name, "an npz file of arrays `vertices` and `faces`")
        if not {"vertices", "faces"} <= arrays.keys():
            found = ", ".join(sorted(arrays)) or "none"
            raise ValueError(f"{name}: expected arrays `vertices` and `faces`, found {found}")
        vertices, faces = arrays["vertices"], arrays["faces"]
    else:
        vertices, faces = _load_with_trimesh(name)
    if faces.size == 0:
        raise ValueError(f"{name}: has no triangles")
    is_real = vertices.dtype.kind in "fiu"  # a Scene refuses other dtypes
    return real.array(vertices) if is_real else vertices, faces


def _load_with_trimesh(name: str) -> tuple[NDArray[Any], NDArray[Any]]:
    try:
        import trimesh
    except ImportError:
        raise ImportError(
            f'{name}: reading mesh files needs trimesh: pip install "wive[trimesh]", or pass an .npz file'
        ) from None
    if os.path.getsize(name) == 0:
        raise ValueError(f"{name}: is empty")
    try:
        mesh = trimesh.load(name, force="mesh", process=False)
    except Exception as error:  # what loaders raise on bad bytes differs by format
        reason = " ".join(str(error).split()) or type(error).__name__
        hint = '; try pip install "trimesh[easy]"' if isinstance(error, ImportError) else ""
        raise ValueError(f"{name}: not a mesh that trimesh can read ({reason:.120}{hint})") from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise ValueError(f"{name}: holds no triangle mesh but a {type(mesh).__name__}")
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int32)
