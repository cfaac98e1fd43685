"""Every hit of rays in chunks: as many per ray as there are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import dask.array as da
import numpy as np

from wive._internal.known_meshes import mesh_attributes
from wive.all_hits import AllHits
from wive.dask.collection import HitCollection


class DaskAllHits(HitCollection):
    """Every hit of each ray: `wive.AllHits` in chunks, whose attributes are dask arrays.

    Arrays with one row per hit, (h,) below, have chunks of unknown sizes (NaN), as if a mask had chosen the
    rows: `compute_chunk_sizes()` finds them. Rays of a leading shape such as (h,w) are numbered in C order.
    A chunk is traced once for all arrays that are computed together. `hits.persist()` keeps the traced chunks
    in memory; `hits.compute()` returns the `wive.AllHits` of all rays, `hits.to_delayed()` those of each
    chunk.
    """

    @property
    def counts(self) -> da.Array:
        """(n,) int32 number of hits per ray."""
        return self._read("counts", np.int32)

    @property
    def offsets(self) -> da.Array:
        """(n+1,) int64, the hits of ray i are rows offsets[i] to offsets[i+1] of the arrays below."""
        counts = self.counts
        if 0 in counts.chunks[0]:  # which dask's cumsum fails at
            counts = counts.rechunk((tuple(size for size in counts.chunks[0] if size) or (0,),))
        return da.concatenate([da.zeros(1, dtype=np.int64), da.cumsum(counts, axis=0, dtype=np.int64)])

    @property
    def ray(self) -> da.Array:
        """(h,) int64 ray of each hit. ValueError if the rays are in chunks of unknown sizes."""
        sizes = self._hits.chunks[0]
        if any(map(math.isnan, sizes)):
            raise ValueError(
                "rays must be in chunks of known sizes to be numbered: call compute_chunk_sizes() on them"
            )
        first = da.from_array(np.cumsum([0, *sizes[:-1]], dtype=np.int64), chunks=1)
        rays = self._each("ray", np.int64)
        added: da.Array = da.blockwise(
            np.add, (0,), rays, (0,), first, (0,), dtype=np.int64, meta=rays._meta, align_arrays=False
        )
        return added

    def _each(self, name: str, dtype: Any, columns: int | None = None, *, of_mesh: bool = False) -> da.Array:
        unknown = (math.nan,) * math.prod(self._hits.numblocks)
        return self._read(name, dtype, columns, of_mesh=of_mesh, adjust_chunks={0: unknown})

    def __len__(self) -> int:
        """Number of rays."""
        return len(self._hits)

    def __repr__(self) -> str:
        """Number of rays and of chunks."""
        return f"DaskAllHits({self._hits.shape[0]} rays in {math.prod(self._hits.numblocks)} chunks)"

    def __dask_postcompute__(self) -> tuple[Any, tuple[()]]:
        """All chunks as one `wive.AllHits`."""
        return joined_all_hits, ()


def joined_all_hits(chunks: Sequence[AllHits]) -> AllHits:
    """The hits of all chunks, one after another."""
    hits = object.__new__(AllHits)
    counts = np.concatenate([np.zeros(1, np.int64), *(np.diff(chunk.offsets) for chunk in chunks)])
    arrays = {
        name: np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in ("t", "prim", "uv")
    }
    geoms = chunks[0]._geoms
    vars(hits).update(offsets=np.cumsum(counts), **arrays, **mesh_attributes(chunks[0]))
    if geoms is not None:
        vars(hits).update(_geoms=geoms)
    return hits
