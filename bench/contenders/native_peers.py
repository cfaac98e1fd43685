"""Other libraries' trees, compiled from folders with their sources, on NumPy arrays: one ray at a time."""

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import BenchError, compiled
from bench.support.rays import Rays
from bench.support.scenes import Mesh

NATIVE = Path(__file__).parents[1] / "native"
FLAGS = ("-O3", "-std=c++20", "-mavx2", "-mfma", "-pthread", "-shared", "-fPIC")  # as their own benches


class Library(NamedTuple):
    """A peer: its shim and, below the folder with its sources, the folder that is searched for headers."""

    shim: str
    headers: str
    first: str  # a header that is there if the folder is the right one


LIBRARIES = {
    "tinybvh": Library("tinybvh_shim.cpp", ".", "tiny_bvh.h"),
    "bvh": Library("bvh_shim.cpp", "src", "bvh/v2/bvh.h"),
}


class _Mesh(ctypes.Structure):
    """Mirror of `PeerMesh` in peer.h."""

    _fields_ = (
        ("vertices", ctypes.c_void_p),
        ("vertex_count", ctypes.c_size_t),
        ("faces", ctypes.c_void_p),
        ("face_count", ctypes.c_size_t),
    )


class _Rays(ctypes.Structure):
    """Mirror of `PeerRays` in peer.h."""

    _fields_ = (
        ("count", ctypes.c_size_t),
        ("origins", ctypes.c_void_p),
        ("directions", ctypes.c_void_p),
        ("tmax", ctypes.c_float),
    )


def peer_library(name: str, sources: Path) -> ctypes.CDLL:
    """The shim of a peer, compiled against the sources in that folder; BenchError if they are not there."""
    library = LIBRARIES[name]
    folder = sources / library.headers
    if not (folder / library.first).is_file():
        raise BenchError(f"{sources}: expected the sources of {name}, with {library.first}")
    flags: Sequence[str] = (*FLAGS, f"-I{NATIVE}", f"-I{folder}")
    shim = ctypes.CDLL(str(compiled(NATIVE / library.shim, flags=flags, headers=(NATIVE, folder))))
    shim.peer_build.restype = ctypes.c_void_p
    shim.peer_build.argtypes = [ctypes.POINTER(_Mesh), ctypes.c_int]
    shim.peer_release.restype = None
    shim.peer_release.argtypes = [ctypes.c_void_p]
    for query in (shim.peer_intersect, shim.peer_occluded):
        query.restype = None
        query.argtypes = [ctypes.c_void_p, ctypes.POINTER(_Rays), ctypes.c_void_p]
    return shim


class PeerTree:
    """A peer's tree over one mesh, built on all cores; `high`: by the better of its two builders."""

    def __init__(self, shim: ctypes.CDLL, mesh: Mesh, *, high: bool) -> None:
        """Build the tree."""
        self._shim = shim
        vertices = np.ascontiguousarray(mesh.vertices, np.float32)
        faces = np.ascontiguousarray(mesh.faces, np.int32)
        given = _Mesh(vertices.ctypes.data, len(vertices), faces.ctypes.data, len(faces))
        self._tree: int | None = shim.peer_build(given, int(high))

    def __enter__(self) -> "PeerTree":
        """Itself; leaving the block frees it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Frees the tree."""
        self._shim.peer_release(self._tree)
        self._tree = None

    def trace(self, rays: Rays) -> NDArray[np.bool_]:
        """(n,) bool, whether each ray hits anything; found by closest hits unless the set is for any hit."""
        hit = np.empty(len(rays), np.bool_)
        given = _Rays(len(rays), rays.origins.ctypes.data, rays.directions.ctypes.data, float(rays.tmax[0]))
        query = self._shim.peer_occluded if rays.any_hit else self._shim.peer_intersect
        query(self._tree, given, hit.ctypes.data)
        return hit
