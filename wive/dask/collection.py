"""Hits in chunks: a dask collection whose chunks are what the scene's query returned for the chunk's rays."""

from __future__ import annotations

import copy
from typing import Any

import dask.array as da
import numpy as np
from dask.base import DaskMethodsMixin
from dask.delayed import Delayed

from wive._internal.known_meshes import OfMesh
from wive.dask.carried import CarriedScene
from wive.dask.rays import VECTOR, ChunkedRays, empty_like, whole
from wive.scene import Scene

# The arrays of hits that a query fills.
TRACED = "t", "prim", "uv"


class HitCollection(DaskMethodsMixin):
    """Hits that dask computes, chunk by chunk; arrays of them share the trace of a chunk.

    `_hits` is an array in form alone: its chunks hold hits, not numbers. Arrays of all hits have a row
    per hit, (h,) in place of (n,), and no misses.
    """

    def __init__(self, hits: da.Array, rays: ChunkedRays, scene: Scene, carried: Delayed) -> None:
        """Keep what arrays are made of."""
        self._hits, self._meta, self._carried = hits, rays.meta, carried
        self._scene = scene

    @property
    def t(self) -> da.Array:
        """(n,) float32 or float64 distances in multiples of the direction's length; inf on a miss."""
        return self._each("t", self._scene.vertices.dtype)

    @property
    def prim(self) -> da.Array:
        """(n,) int32 triangles; -1 on a miss."""
        return self._each("prim", np.int32)

    @property
    def uv(self) -> da.Array:
        """(n,2) float32 or float64 barycentrics; NaN on a miss."""
        return self._each("uv", self._scene.vertices.dtype, 2)

    @property
    def geom(self) -> da.Array:
        """(n,) int32 meshes of `Scene.from_meshes`; -1 on a miss."""
        return self._each("geom", np.int32)

    @property
    def geom_prim(self) -> da.Array:
        """(n,) int32 triangles as rows of their own meshes; -1 on a miss."""
        return self._each("geom_prim", np.int32)

    def points(self) -> da.Array:
        """(n,3) float64 points from the barycentrics; NaN on a miss."""
        return self._each("points", np.float64, 3, of_mesh=True)

    def normals(self) -> da.Array:
        """(n,3) float64 unit normals; NaN on a miss."""
        return self._each("normals", np.float64, 3, of_mesh=True)

    def _each(self, name: str, dtype: Any, columns: int | None = None, *, of_mesh: bool = False) -> da.Array:
        """An array of one row per ray, or per hit if there may be several."""
        return self._read(name, dtype, columns, of_mesh=of_mesh)

    def _read(
        self,
        name: str,
        dtype: Any,
        columns: int | None = None,
        *,
        of_mesh: bool = False,
        given: tuple[Any, ...] = (),
        **keywords: Any,
    ) -> da.Array:
        """The attribute, or what the method of that name returns, of the hits of each chunk.

        `given`: arguments of the method, each followed by the labels of its axes. `of_mesh`: it needs the
        mesh, which hits from another process don't have.
        """
        labels = tuple(range(self._hits.ndim))
        added = {} if columns is None else {VECTOR: columns}
        fixed = [self._hits, labels, name, None, self._carried if of_mesh else None, None]
        return da.blockwise(
            _read_chunk,
            (*labels, *added),
            *fixed,
            *given,
            new_axes={} if any(VECTOR in (part or ()) for part in given[1::2]) else added,
            dtype=dtype,
            meta=empty_like(self._meta, dtype, len(labels) + len(added)),
            token=f"wive-{name}",
            **keywords,
        )

    def to_delayed(self) -> list[Delayed]:
        """The hits of each chunk, in C order, as Delayed objects."""
        found: list[Delayed] = self._hits.to_delayed().ravel().tolist()
        return found

    def __dask_graph__(self) -> Any:
        """The graph."""
        return self._hits.__dask_graph__()

    def __dask_layers__(self) -> Any:
        """The layers whose keys are the chunks."""
        return self._hits.__dask_layers__()

    def __dask_keys__(self) -> Any:
        """The chunks."""
        return self._hits.__dask_keys__()

    def __dask_tokenize__(self) -> str:
        """The name of the chunks."""
        return str(self._hits.name)

    __dask_optimize__ = staticmethod(da.Array.__dask_optimize__)
    __dask_scheduler__ = staticmethod(da.Array.__dask_scheduler__)

    def __dask_postpersist__(self) -> tuple[Any, tuple[()]]:
        """The same with computed chunks."""
        return self._with_chunks, ()

    def _with_chunks(self, graph: Any, *, rename: Any = None) -> Any:
        rebuild, arguments = self._hits.__dask_postpersist__()
        renamed = {} if rename is None else {"rename": rename}
        found = copy.copy(self)
        found._hits = rebuild(graph, *arguments, **renamed)
        return found


def _read_chunk(hits: Any, name: str, carried: CarriedScene | None, *given: Any) -> Any:
    hits = whole(hits)
    if carried is not None:
        hits = with_mesh(hits, carried.scene)
    value = getattr(hits, name)
    return value(*map(whole, given)) if callable(value) else value


def with_mesh(hits: OfMesh, scene: Scene) -> OfMesh:
    """The hits, with the mesh if they came without."""
    return hits if "vertices" in vars(hits) else hits.with_mesh(scene)
