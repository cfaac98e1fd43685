"""Formats that trimesh reads."""

from __future__ import annotations

import io

import numpy as np

from wive._internal.formats import Mesh


def read(data: bytes, name: str, kind: str) -> Mesh:
    """Read a file with this extension, given without its dot; meshes of a scene are placed and joined."""
    try:
        import trimesh
    except ImportError:
        raise ImportError(
            f'{name}: reading {kind or "such"} files needs trimesh: pip install "wive[trimesh]", '
            "or convert the file to PLY, OBJ, STL, OFF or glTF"
        ) from None
    try:
        mesh = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
    except MemoryError:
        raise
    except Exception as error:  # what loaders raise on bad bytes differs by format
        reason = " ".join(str(error).split()) or type(error).__name__
        hint = '; try pip install "trimesh[easy]"' if isinstance(error, ImportError) else ""
        raise ValueError(f"{name}: not a mesh that trimesh can read ({reason:.120}{hint})") from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise ValueError(f"{name}: holds no triangle mesh but a {type(mesh).__name__}")
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)
