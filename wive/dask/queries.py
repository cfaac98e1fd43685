"""Queries of rays in chunks."""

from __future__ import annotations

import math
from typing import Any

import dask.array as da
import numpy as np
from dask.delayed import Delayed

from wive._internal.options import LanesOption
from wive._internal.options import work as checked_work
from wive.dask.all_hits import DaskAllHits
from wive.dask.carried import CarriedScene, carried
from wive.dask.hits import DaskHits
from wive.dask.rays import ChunkedRays, Given, chunked_rays, empty_like, whole
from wive.scene import Scene


def intersect(
    scene: Scene,
    origins: Given,
    directions: Given,
    tmin: Given = 0.0,
    tmax: Given = math.inf,
    *,
    threads: int | None = None,
    in_flight: int | None = None,
    lanes: LanesOption = "auto",
) -> DaskHits:
    """The closest hit of each ray, as `Scene.intersect`, chunk by chunk.

    Arguments:
        scene: put into the graph once, as it is now. A scene from `wive.load` or after `scene.share()` takes
            some 200 bytes there, any other its mesh; each worker process opens it once. docs/dask.md has
            which one to use.
        origins, directions: dask arrays (n,3) of real numbers, or of another leading shape, in any chunks,
            also of unknown sizes; one of them may be NumPy's, or a row (3,) that all rays share.
        tmin, tmax: a number, or one per ray: dask's or NumPy's, of the rays' leading shape.
        threads: per chunk; None is one, because dask computes as many chunks at a time as its workers have
            threads. For CPU backends.
        in_flight, lanes: as for `Scene.intersect`.

    Raises ValueError or TypeError, in one line naming the argument, before anything is computed.

    >>> hits = wive.dask.intersect(scene, origins, directions)
    >>> t, prim = dask.compute(hits.t, hits.prim)   # one trace
    """
    query = _Query(scene, "intersect", threads, in_flight, lanes)
    rays = chunked_rays(origins, directions, tmin, tmax)
    return DaskHits(query.of(rays, object, np.empty((0,) * len(rays.leading), object)), rays, *query.source)


def occluded(
    scene: Scene,
    origins: Given,
    directions: Given,
    tmin: Given = 0.0,
    tmax: Given = math.inf,
    *,
    threads: int | None = None,
    in_flight: int | None = None,
    lanes: LanesOption = "auto",
) -> da.Array:
    """(n,) bool: whether each ray hits anything; arguments are those of `wive.dask.intersect`."""
    query = _Query(scene, "occluded", threads, in_flight, lanes)
    return query.answers(chunked_rays(origins, directions, tmin, tmax), np.bool_)


def count(
    scene: Scene,
    origins: Given,
    directions: Given,
    tmin: Given = 0.0,
    tmax: Given = math.inf,
    *,
    threads: int | None = None,
    in_flight: int | None = None,
    lanes: LanesOption = "auto",
    touching: bool = False,
) -> da.Array:
    """(n,) int32: how many hits `intersect_all` finds for each ray; arguments are the same."""
    query = _Query(scene, "count", threads, in_flight, lanes, touching=touching)
    return query.answers(chunked_rays(origins, directions, tmin, tmax), np.int32)


def intersect_all(
    scene: Scene,
    origins: Given,
    directions: Given,
    tmin: Given = 0.0,
    tmax: Given = math.inf,
    *,
    threads: int | None = None,
    in_flight: int | None = None,
    lanes: LanesOption = "auto",
    touching: bool = False,
    max_bytes: int | None = None,
) -> DaskAllHits:
    """Every hit of each ray, as `Scene.intersect_all`, chunk by chunk.

    Arguments are those of `wive.dask.intersect`, and `touching` and `max_bytes` those of
    `Scene.intersect_all`; `max_bytes` is what the hits of one chunk may take. Rays of more leading axes than
    one are put into chunks along the first alone, so that they keep their C order.

    >>> hits = wive.dask.intersect_all(scene, origins, directions)
    >>> t, ray = dask.compute(hits.t, hits.ray)
    """
    query = _Query(scene, "intersect_all", threads, in_flight, lanes, touching=touching, max_bytes=max_bytes)
    rays = chunked_rays(origins, directions, tmin, tmax)
    return DaskAllHits(query.of_rows(rays), rays, *query.source)


class _Query:
    """A query with checked options, and the scene that the graph carries."""

    def __init__(
        self,
        scene: Scene,
        name: str,
        threads: int | None,
        in_flight: int | None,
        lanes: LanesOption,
        **options: Any,
    ) -> None:
        found, once = carried(scene)
        self.source: tuple[Scene, Delayed] = found.scene, once
        self._name = name
        lacks = scene._tracer.lacks
        touching, most = options.get("touching", False), options.get("max_bytes")
        checked_work(scene.backend, lacks, threads, in_flight, lanes, False, touching, most)
        if threads is None and "threads" not in lacks:
            threads = 1
        self._options = {"threads": threads, "in_flight": in_flight, "lanes": lanes, **options}

    def answers(self, rays: ChunkedRays, dtype: Any) -> da.Array:
        """One number per ray."""
        return self.of(rays, dtype, empty_like(rays.meta, dtype, len(rays.leading)))

    def of(self, rays: ChunkedRays, dtype: Any, meta: Any, **keywords: Any) -> da.Array:
        """The answers of all chunks, with the rays' leading axes."""
        labels = keywords.pop("labels", rays.labels)
        fixed = [self.source[1], None, self._name, None, self._options, None]
        token = f"wive-{self._name.replace('_', '-')}"
        return da.blockwise(
            _trace, labels, *fixed, *rays.flat, dtype=dtype, meta=meta, token=token, **keywords
        )

    def of_rows(self, rays: ChunkedRays) -> da.Array:
        """The answers of all chunks along the first axis, one row per ray."""
        if len(rays.leading) > 1:
            one_piece = {axis: -1 for axis in rays.labels[1:]}
            pairs = tuple(
                (value.rechunk(one_piece) if labels and len(labels) > 1 else value, labels)
                for value, labels in rays.pairs
            )
            rays = rays._replace(pairs=pairs)
        per_row = math.prod(rays.leading[1:])
        meta = np.empty(0, object)
        return self.of(rays, object, meta, labels=(0,), adjust_chunks={0: lambda size: size * per_row})


def _trace(carried: CarriedScene, name: str, options: dict[str, Any], *rays: Any) -> Any:
    return getattr(carried.scene, name)(*map(whole, rays), **options)
