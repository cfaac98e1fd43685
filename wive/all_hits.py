"""What `Scene.intersect_all` returns: every hit along every ray."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.known_meshes import OfMesh, mesh_attributes
from wive._internal.precision import Floats
from wive._internal.wrapping import Wrapping, from_home
from wive.geoms import Geoms
from wive.hits import geoms_of, surface_normals, surface_points


class AllHits(OfMesh):
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

    @property
    def geom(self) -> NDArray[np.int32]:
        """(h,) int32, the mesh of each hit, as `Hits.geom`; computed when read."""
        return geoms_of(self).of(self.prim)

    @property
    def geom_prim(self) -> NDArray[np.int32]:
        """(h,) int32, the row of each hit in the faces of its own mesh, as `Hits.geom_prim`."""
        return geoms_of(self).within(self.prim)

    def points(self) -> NDArray[np.float64]:
        """(h,3) float64 hit points from the barycentrics, as `Hits.points`; computed at each call."""
        return surface_points(self.vertices, self.faces, self.prim, self.uv)

    def normals(self) -> NDArray[np.float64]:
        """(h,3) float64 unit normals by the right-hand winding, as `Hits.normals`; computed at each call."""
        return surface_normals(self.vertices, self.faces, self.prim)

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
        offsets, t, prim, uv = map(wrapping.wrap, (home.offsets, home.t, home.prim, home.uv))
        vars(self).update(offsets=offsets, t=t, prim=prim, uv=uv)
        vars(self).update(mesh_attributes(home), _home=home, _wrapping=wrapping)

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
        library = type(self.t).__module__.partition(".")[0]
        return f"AllHits({len(self)} rays, {self._home.t.shape[0]} hits, in arrays of {library})"


def row_of(i: int, count: int) -> int:
    """`i` as an index from 0; a negative `i` counts from the end."""
    row = operator.index(i)
    if not -count <= row < count:
        raise IndexError(f"ray {row} of {count}: count from 0 to {count - 1}")
    return row % count
