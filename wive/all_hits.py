"""What `Scene.intersect_all` returns: every hit along every ray."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.known_meshes import OfMesh
from wive._internal.precision import Floats
from wive._internal.wrapping import Wrapping, from_home, keep_wrapped, library_name
from wive.geoms import Geoms
from wive.hits import OnTriangles


class AllHits(OnTriangles, OfMesh):
    """All hits of n rays, h in all: ray by ray, each ray's by ascending t, at equal t by ascending prim.

    Arrays are NumPy's if the rays were, else of the library and on the device that the rays came in;
    `vertices` and `faces` are always NumPy's. `all_hits[i]` holds the hits of ray i, again as `AllHits`, and
    iterating yields `all_hits[0]`, `all_hits[1]`, ...

    Attributes:
        offsets: (n+1,) int64, the hits of ray i are rows offsets[i] to offsets[i+1] of the arrays below.
        t: (h,) float32, distance in multiples of the direction's length.
        prim: (h,) int32, row of `faces` that was hit, also in a scene of several meshes.
        uv: (h,2) float32, the hit point is (1-u-v) v0 + u v1 + v v2.
        vertices: (v,3) float32 and
        faces: (f,3) int32, the mesh that `prim` refers to.

    t, uv and vertices are float64 for a float64 scene. Pickles name the mesh, as those of `Hits`.
    """

    offsets: NDArray[np.int64]
    t: Floats
    prim: NDArray[np.int32]
    uv: Floats
    vertices: Floats
    faces: NDArray[np.int32]
    _geoms: Geoms | None = None

    def __init__(
        self,
        offsets: NDArray[np.int64],
        t: Floats,
        prim: NDArray[np.int32],
        uv: Floats,
        vertices: Floats,
        faces: NDArray[np.int32],
        geoms: Geoms | None = None,
    ) -> None:
        """Keep the arrays."""
        vars(self).update(offsets=offsets, t=t, prim=prim, uv=uv, vertices=vertices, faces=faces)
        if geoms is not None:
            vars(self).update(_geoms=geoms)

    @property
    def counts(self) -> NDArray[np.int32]:
        """(n,) int32 number of hits per ray; computed at each call."""
        return np.diff(self.offsets).astype(np.int32)

    @property
    def ray(self) -> NDArray[np.int64]:
        """(h,) int64 ray of each hit; computed at each call."""
        return np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.offsets))

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> AllHits:
        """The hits of ray i, in views of the same arrays; IndexError if there is no such ray."""
        first, last = (int(offset) for offset in self.offsets[row_of(i, len(self)) :][:2])
        rows = slice(first, last)
        offsets = np.array([0, last - first], np.int64)
        arrays = self.t[rows], self.prim[rows], self.uv[rows]
        return AllHits(offsets, *arrays, self.vertices, self.faces, self._geoms)

    def __iter__(self) -> Iterator[AllHits]:
        """The hits of each ray in turn."""
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        """Number of rays and of hits."""
        return f"AllHits({len(self)} rays, {len(self.t)} hits)"


class WrappedAllHits(AllHits):
    """All hits in the arrays of another library than the backend's; `_home` holds the backend's arrays."""

    _home: Any
    _wrapping: Wrapping

    def __init__(self, home: Any, wrapping: Wrapping) -> None:
        """Wrap the arrays of `home`, an `AllHits` or a `WarpAllHits`; all else is computed when used."""
        keep_wrapped(self, home, wrapping, "offsets", "t", "prim", "uv")

    counts = from_home(AllHits.counts)
    ray = from_home(AllHits.ray)
    geom = from_home(AllHits.geom)
    geom_prim = from_home(AllHits.geom_prim)
    points = from_home(AllHits.points)
    normals = from_home(AllHits.normals)

    def __len__(self) -> int:
        """Number of rays."""
        return len(self._home)

    def __getitem__(self, i: int) -> AllHits:
        """The hits of ray i; on a device this waits for it."""
        with self._wrapping.on_stream():
            return WrappedAllHits(self._home[i], self._wrapping)

    def __repr__(self) -> str:
        """Number of rays and of hits, and the library of their arrays."""
        hits = self._home.t.shape[0]
        return f"AllHits({len(self)} rays, {hits} hits, in arrays of {library_name(self.t)})"


def row_of(i: int, count: int) -> int:
    """`i` as an index from 0; a negative `i` counts from the end."""
    row = operator.index(i)
    if not -count <= row < count:
        raise IndexError(f"ray {row} of {count}: count from 0 to {count - 1}")
    return row % count
