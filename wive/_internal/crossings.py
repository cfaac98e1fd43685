"""The queries for everything along a ray: all hits, and how many there are."""

from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.arrays import NUMPY
from wive._internal.precision import Real
from wive._internal.rays import check_rays
from wive.all_hits import AllHits, WrappedAllHits
from wive.hits import Stats, stats_of

if TYPE_CHECKING:
    from wive.warp_kernels.scene.tracer import WarpTracer

LanesOption = Literal["auto", 8, 1]


class CrossingQueries:
    """The part of `wive.Scene` that does not stop at the first hit."""

    _bvh: _cpu.Bvh
    _faces: NDArray[np.int32]
    _real: Real
    _backend: str
    _device: str | None
    _warp: "WarpTracer | None"

    @overload
    def intersect_all(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[False] = False,
    ) -> AllHits: ...
    @overload
    def intersect_all(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[True],
    ) -> tuple[AllHits, Stats]: ...
    def intersect_all(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: bool = False,
    ) -> AllHits | tuple[AllHits, Stats]:
        """Every triangle that each ray meets with tmin <= t <= tmax, each once, however many there are.

        Arguments are those of `intersect`. Each ray's hits come by ascending t, at equal t by ascending prim;
        the first is what `intersect` returns. A ray through an edge or a vertex meets every triangle there.
        Not so with accuracy "exact": there a ray passes a closed surface as often as beside the edge, so that
        parity is always right, and a hit of `intersect` that only touches an edge may be missing.

        CPU backends trace once; a hit takes 24 bytes until all are found, then 16 (in float64 40, then 28).
        Warp traces twice, to count and to fill, and waits for the device in between: CUDA graphs can't
        capture this query.

        Raises ValueError or TypeError, in one line naming the argument, and MemoryError where the hits don't
        fit into memory (on a Warp device that is full, RuntimeError).
        """
        rays = check_rays(origins, directions, tmin, tmax, self._backend, self._device)
        chosen = arguments.lanes(lanes, self._warp is not None)
        work = arguments.work(threads, in_flight, stats)
        counts: Stats | None
        if self._warp is not None:
            hits, counts = self._warp.intersect_all(rays, chosen, bool(stats))
        else:
            bvh = self._bvh
            offsets, t, prim, uv, table = bvh.intersect_all(self._backend, *rays.numpy(self._real), *work)
            hits = AllHits(offsets, t, prim, uv, bvh.vertices, self._faces)
            counts = stats_of(table, rays.library)
            if rays.library is not NUMPY:
                hits = WrappedAllHits(hits, rays.library.from_numpy)
        return hits if counts is None else (hits, counts)

    @overload
    def count(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[False] = False,
    ) -> NDArray[np.int32]: ...
    @overload
    def count(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[True],
    ) -> tuple[NDArray[np.int32], Stats]: ...
    def count(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: bool = False,
    ) -> NDArray[np.int32] | tuple[NDArray[np.int32], Stats]:
        """(n,) int32: how many hits `intersect_all` finds for each ray; arguments as for `intersect`."""
        rays = check_rays(origins, directions, tmin, tmax, self._backend, self._device)
        chosen = arguments.lanes(lanes, self._warp is not None)
        work = arguments.work(threads, in_flight, stats)
        counted: Any
        steps: Stats | None
        if self._warp is not None:
            counted, steps = self._warp.count(rays, chosen, bool(stats))
        else:
            found, table = self._bvh.count(self._backend, *rays.numpy(self._real), *work)
            counted, steps = rays.library.from_numpy(found), stats_of(table, rays.library)
        return counted if steps is None else (counted, steps)
