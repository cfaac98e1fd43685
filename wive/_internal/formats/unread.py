"""Formats that are not read, and what to do with a file of each."""

from __future__ import annotations

READ = "PLY, OBJ, STL, OFF, glTF, 3MF or COLLADA"
CONVERT = f"convert it to {READ}"
POINTS = "holds points and no triangles: make a mesh of them first"
SURFACES = (
    "holds surfaces and no triangles: tessellate it, as cascadio (PyPI) does: load_mesh(cascadio.load(data))"
)
ARCHIVE = "is an archive: unpack it and load the mesh file that it holds"
COMPRESSED = "is compressed: unpack it, or pass a file object that does, such as gzip.open(path)"
DRAWING = "holds a drawing and no triangles"
REASONS = {
    **dict.fromkeys(("xyz", "xyzn", "xyzrgb", "pts", "pcd", "las", "laz", "e57"), POINTS),
    **dict.fromkeys(("step", "stp", "iges", "igs"), SURFACES),
    **dict.fromkeys(("zip", "tar", "tar.gz", "tgz", "7z", "rar"), ARCHIVE),
    **dict.fromkeys(("gz", "bz2", "xz", "zst"), COMPRESSED),
    **dict.fromkeys(("dxf", "svg"), DRAWING),
    "binvox": f"holds voxels and no triangles: make a mesh of them first, then {CONVERT}",
}


def unread(name: str, kind: str) -> ValueError:
    """Why a file of this kind (its extension without the dot) is not read."""
    return ValueError(f"{name}: {REASONS.get(kind, f'files of type {kind!r:.20} are not read: {CONVERT}')}")
