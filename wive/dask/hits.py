"""Closest hits of rays in chunks."""

from __future__ import annotations

import math
from typing import Any

import dask.array as da
import numpy as np
from dask.delayed import delayed
from numpy.typing import ArrayLike

from wive._internal.arrays import NUMPY
from wive._internal.host_arrays import host_array
from wive._internal.interpolation import vertex_values_of
from wive._internal.known_meshes import mesh_attributes
from wive._internal.shaped import ShapedHits
from wive._internal.shapes import Leading
from wive.dask.collection import TRACED, HitCollection
from wive.dask.rays import Given, as_vectors, labelled, same_shape
from wive.hits import Hits


class DaskHits(HitCollection):
    """The closest hit of each ray: `wive.Hits` in chunks, whose attributes are dask arrays.

    Shapes and dtypes are those of `wive.Hits`, with the rays' leading shape in place of (n,). A chunk is
    traced once for all of them that are computed together. `hits.persist()` keeps the traced chunks in
    memory; `hits.compute()` returns the `wive.Hits` of all rays, without the rays: use `front`, `cosines` and
    `error_bound` here.
    """

    @property
    def mask(self) -> da.Array:
        """(n,) bool, true if the ray hit something."""
        return self._read("mask", np.bool_)

    @property
    def front(self) -> da.Array:
        """(n,) bool, whether the ray meets the side that the normal points to."""
        return self._read("front", np.bool_, of_mesh=True)

    @property
    def error_bound(self) -> da.Array:
        """(n,) float64 upper bounds on the error of t; NaN on a miss."""
        return self._read("error_bound", np.float64, of_mesh=True)

    def cosines(self) -> da.Array:
        """(n,) float64 |normal . direction| / |direction|; NaN on a miss."""
        return self._read("cosines", np.float64, of_mesh=True)

    def spawn(self, directions: Given) -> da.Array:
        """(n,3) origins for rays that leave the surface along directions (n,3), or (3,) for all."""
        vectors, leading = as_vectors("directions", directions), self._hits.shape
        if vectors.ndim > 1 and not same_shape(vectors.shape[:-1], leading):
            raise ValueError(
                f"directions must have shape {(*leading, 3)}, one per hit, or (3,), got {vectors.shape}"
            )
        given = labelled("directions", vectors, leading, self._hits.chunks)
        return self._read("spawn", self._scene.vertices.dtype, 3, of_mesh=True, given=given)

    def interpolate(self, vertex_values: ArrayLike) -> da.Array:
        """(n,) or (n,k) values given at the vertices, (v,) or (v,k), at the points hit; NaN on a miss."""
        values = vertex_values_of(host_array("vertex_values", vertex_values), len(self._scene.vertices))
        dtype = np.float32 if values.dtype in (np.float16, np.float32) else np.float64
        columns = values.shape[1] if values.ndim == 2 else None
        once = delayed(values, pure=True, traverse=False)
        return self._read("interpolate", dtype, columns, of_mesh=True, given=(once, None))

    @property
    def shape(self) -> tuple[int, ...]:
        """The rays' leading shape."""
        found: tuple[int, ...] = self._hits.shape
        return found

    @property
    def chunks(self) -> tuple[tuple[int, ...], ...]:
        """How many rays each chunk has, per leading axis."""
        found: tuple[tuple[int, ...], ...] = self._hits.chunks
        return found

    def __len__(self) -> int:
        """Length of the first axis of the rays."""
        return len(self._hits)

    def __repr__(self) -> str:
        """Shape and number of chunks."""
        return f"DaskHits({self.shape} rays in {math.prod(self._hits.numblocks)} chunks)"

    def __dask_postcompute__(self) -> tuple[Any, tuple[()]]:
        """All chunks as one `wive.Hits`."""
        return joined_hits, ()


def joined_hits(chunks: Any) -> Hits:
    """The hits of all chunks, nested as their keys are."""
    first = chunks
    while isinstance(first, list | tuple):
        first = first[0]
    t, prim, uv = (_joined(chunks, name) for name in TRACED)
    home = vars(first).get("_home", first)
    hits = object.__new__(Hits)
    flat = t.reshape(-1), prim.reshape(-1), uv.reshape(-1, 2)
    vars(hits).update(
        zip(TRACED, flat, strict=True),
        **mesh_attributes(home),
        _rays=None,
        _accuracy=home._accuracy,
        _moved=None,
        _geoms=home._geoms,
    )
    return hits if t.ndim == 1 else ShapedHits(hits, Leading(NUMPY, t.shape))


def _joined(chunks: Any, name: str) -> Any:
    def arrays(part: Any) -> Any:
        if isinstance(part, list | tuple):
            return [arrays(one) for one in part]
        array = getattr(part, name)
        return [array] if name == "uv" else array  # as deep as it has axes

    return da.core.concatenate3(arrays(chunks))
