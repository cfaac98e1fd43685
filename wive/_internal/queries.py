"""The queries of a scene: what `wive.Scene` answers once its tree stands."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal.arrays import NUMPY
from wive._internal.gradients import warn_of_lost_gradients
from wive._internal.options import USUAL_WORK, LanesOption, Work
from wive._internal.options import work as checked_work
from wive._internal.precision import Floats
from wive._internal.progress import ProgressOption, checked_progress, reported
from wive._internal.rays import NAMES, Rays, check_rays, ray_count
from wive._internal.segments import visible
from wive._internal.shaped import query_shaped
from wive._internal.spawn import spawn_from
from wive._internal.tracer import Tracer
from wive.all_hits import AllHits
from wive.hits import Hits, Stats

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from wive._internal.options import Counted, CountedAll, CountedCount, Given, Plain, PlainAll, PlainCount

Answer = TypeVar("Answer")
# Queries whose results change smoothly with their rays.
SMOOTH = "intersect", "intersect_all"


class Queries:
    """Queries of the tree that `_tracer` holds; each reads it once, because a refit replaces it."""

    _tracer: Tracer
    _faces: NDArray[np.int32]

    @overload
    def intersect(
        self, origins: Given, directions: Given, tmin: Given = 0, tmax: Given = np.inf, **how: Unpack[Plain]
    ) -> Hits: ...
    @overload
    def intersect(
        self, origins: Given, directions: Given, tmin: Given = 0, tmax: Given = np.inf, **how: Unpack[Counted]
    ) -> tuple[Hits, Stats]: ...
    def intersect(
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
        progress: ProgressOption = None,
    ) -> Hits | tuple[Hits, Stats]:
        """The closest hit of each ray with tmin <= t <= tmax.

        Arguments:
            origins, directions: (n,3) real numbers, or of any other leading shape, such as the (h,w,3) of a
                picture, which the hits then have in place of (n,); one of shape (3,) is shared by all rays.
                C-contiguous arrays of the scene's dtype are not copied, others are converted once. Directions
                may have any length. Warp, torch and DLPack arrays give hits in arrays of their library, on
                their device, without passing through the host; for a Warp scene they must lie on its device
                and have its dtype. No call waits for the GPU then: with Warp's memory pools, CUDA graphs can
                capture it. Hits carry no gradient to torch's tensors; those of `wive.torch.intersect` do.
            tmin, tmax: a number, or one per ray, (n,) or of the rays' leading shape, in multiples of the
                direction's length.
            threads: how many to use; None is every core. For CPU backends.
            in_flight: rays interleaved per thread; None leaves it to wive, 1 is plain single-ray traversal.
                For CPU backends.
            lanes: lanes of a node per thread, for backend "warp": 8 gives a ray one thread (throughput), 1
                gives it eight (latency), "auto" chooses by device and number of rays.
            stats: return `(hits, stats)`, with what each ray visited.
            progress: True shows a bar, if there is tqdm; or a callable, called as progress(done, total) with
                numbers of rays, as for `Scene`.

        Results depend on none of `threads`, `in_flight` and `lanes`, nor on how rays are split into batches.
        A ray misses if its origin is NaN or infinite, its direction is NaN, infinite or zero, a number of it
        is masked, or its tmin is above its tmax. Rays may start far away from a float32 scene, which brings
        them near in float64 first; not arrays of other libraries for Warp, and float32 rays not if the
        accuracy is "exact", which takes them as they are.

        Raises ValueError or TypeError, in one line naming the argument; an option that is only for other
        backends than the scene's raises ValueError.
        """
        if progress is not None:
            options = threads, in_flight, lanes, stats
            return self._watched(
                progress, self._tracer.intersect, (origins, directions, tmin, tmax), *options
            )
        return self._query(
            self._tracer.intersect, (origins, directions, tmin, tmax), threads, in_flight, lanes, stats
        )

    @overload
    def occluded(
        self, origins: Given, directions: Given, tmin: Given = 0, tmax: Given = np.inf, **how: Unpack[Plain]
    ) -> NDArray[np.bool_]: ...
    @overload
    def occluded(
        self, origins: Given, directions: Given, tmin: Given = 0, tmax: Given = np.inf, **how: Unpack[Counted]
    ) -> tuple[NDArray[np.bool_], Stats]: ...
    def occluded(
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
        progress: ProgressOption = None,
    ) -> NDArray[np.bool_] | tuple[NDArray[np.bool_], Stats]:
        """(n,) bool: whether each ray hits anything with tmin <= t <= tmax; arguments as for `intersect`.

        Of the rays' leading shape if that is another, as all that queries return for each ray.
        """
        if progress is not None:
            options = threads, in_flight, lanes, stats
            return self._watched(progress, self._tracer.occluded, (origins, directions, tmin, tmax), *options)
        return self._query(
            self._tracer.occluded, (origins, directions, tmin, tmax), threads, in_flight, lanes, stats
        )

    @overload
    def intersect_all(
        self,
        origins: Given,
        directions: Given,
        tmin: Given = 0,
        tmax: Given = np.inf,
        **how: Unpack[PlainAll],
    ) -> AllHits: ...
    @overload
    def intersect_all(
        self,
        origins: Given,
        directions: Given,
        tmin: Given = 0,
        tmax: Given = np.inf,
        **how: Unpack[CountedAll],
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
        touching: bool = False,
        max_bytes: int | None = None,
        progress: ProgressOption = None,
    ) -> AllHits | tuple[AllHits, Stats]:
        """Every crossing of each ray with the surface at tmin <= t <= tmax, however many there are.

        A ray through an edge or a vertex crosses a closed surface as often as a ray beside it: once if it
        passes into the solid or out of it. Parity is always right, except in accuracy "fast". A ray that only
        touches an edge or a vertex, and one through the border of an open surface, may have no hit here,
        though `intersect` reports one.

        Each ray's hits are sorted by ascending t, at equal t by ascending prim. Rays of a leading shape such
        as (h,w) are numbered in C order: ray (i,j) is i * w + j.

        CPU backends trace once; a hit takes 24 bytes until all are found, then 16 (in float64 40, then 28).
        Warp traces twice, to count and to fill, and waits for the device in between: CUDA graphs can't
        capture this query. A hit takes 32 bytes there until all are sorted, then 16 (in float64 64, then 28).

        Arguments are those of `intersect`, and:

        Arguments:
            touching: every triangle that the ray touches instead, all of those at an edge or a vertex, so
                that the first is what `intersect` returns. Accuracy "fast" does this always.
            max_bytes: what the hits may take while they are found and sorted. None is three quarters of the
                memory that is available, control groups (containers) considered.

        Raises ValueError or TypeError, in one line naming the argument, and MemoryError as soon as the hits
        take more than `max_bytes`, which names their number so far, or don't fit into memory.
        """
        options = threads, in_flight, lanes, stats, touching, max_bytes
        rays = origins, directions, tmin, tmax
        if progress is not None:
            return self._watched(progress, self._tracer.intersect_all, rays, *options)
        return self._query(self._tracer.intersect_all, rays, *options)

    @overload
    def count(
        self,
        origins: Given,
        directions: Given,
        tmin: Given = 0,
        tmax: Given = np.inf,
        **how: Unpack[PlainCount],
    ) -> NDArray[np.int32]: ...
    @overload
    def count(
        self,
        origins: Given,
        directions: Given,
        tmin: Given = 0,
        tmax: Given = np.inf,
        **how: Unpack[CountedCount],
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
        touching: bool = False,
        progress: ProgressOption = None,
    ) -> NDArray[np.int32] | tuple[NDArray[np.int32], Stats]:
        """(n,) int32: how many hits `intersect_all` finds for each ray; arguments are the same."""
        if progress is not None:
            options = threads, in_flight, lanes, stats, touching
            return self._watched(progress, self._tracer.count, (origins, directions, tmin, tmax), *options)
        return self._query(
            self._tracer.count, (origins, directions, tmin, tmax), threads, in_flight, lanes, stats, touching
        )

    def visible(
        self, a: ArrayLike, b: ArrayLike, *, threads: int | None = None, progress: ProgressOption = None
    ) -> NDArray[np.bool_]:
        """(n,) bool: whether the open segment between each point of `a` and its point of `b` is free.

        A triangle is in the way if the segment meets it and it separates the ends: each is farther off the
        plane of the triangle than rounding moves a point on it. So points on surfaces are not hidden by the
        triangles they lie on: `hits.points()`, vertices, centres, samples, in float32 as well;
        docs/accuracy.md, "Line of sight", has that distance, and recipes. Surfaces have no inside here: two
        points of a sphere see each other through it. A point sees itself; one with a coordinate that is NaN,
        infinite, masked or beyond 1e18 is seen by none. `visible(b, a)` is the same.

        Arguments:
            a, b: (n,3) real numbers, or of another leading shape, or (3,) for all; torch, Warp and DLPack
                arrays in host memory give an array of their library. Points are not rounded to the scene's
                precision, their rays are.
            threads: how many to use; None is every core. For CPU backends.
            progress: True for a bar, or a callable of (done, total) in segments, as for `Scene`.

        Raises ValueError or TypeError, in one line naming the argument.

        >>> seen = scene.visible(observer, hits.points())
        """
        tracer = self._tracer
        work = checked_work(tracer.backend, tracer.lacks, threads, None, "auto", False)
        free: NDArray[np.bool_] = reported(
            checked_progress(progress),
            ray_count(a, b),
            "segment",
            "looking",
            lambda: visible(tracer, self._faces, a, b, work),
        )
        return free

    def spawn(self, prim: ArrayLike, uv: ArrayLike, directions: ArrayLike) -> Floats:
        """(n,3) origins for rays that leave the surface from points of yours, as `Hits.spawn` from hits.

        A ray from there along its direction, with tmin = 0, doesn't hit the triangle that it leaves.

        Arguments:
            prim: (n,) integers, or of another leading shape, rows of `faces`; -1 for no triangle, and a
                zero-area one, give NaN, and rays from there miss.
            uv: (n,2) real numbers, or (2,) for all: the point is (1-u-v) v0 + u v1 + v v2, for example
                (1/3, 1/3) for the middle of each triangle.
            directions: (n,3) real numbers, or (3,) for all; of any length.

        Arrays of torch, Warp or DLPack must be in host memory; the answer is of their library. It is float32,
        or float64 for a float64 scene.

        Raises ValueError or TypeError, in one line naming the argument, and the first row of `prim` that is
        no triangle.

        >>> origins = scene.spawn(np.arange(len(scene)), (1 / 3, 1 / 3), inwards)
        >>> thickness = scene.intersect(origins, inwards).t
        """
        bvh = self._tracer.bvh
        origins: Floats = spawn_from(bvh.vertices, self._faces, prim, uv, directions, bvh.accuracy)
        return origins

    def _watched(
        self,
        progress: ProgressOption,
        query: Callable[[Rays, Work], tuple[Answer, Stats | None]],
        rays: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike],
        *options: Any,
    ) -> Answer | tuple[Answer, Stats]:
        """What `_query` returns; meanwhile `progress` hears how far it is."""
        if checked_progress(progress) is False:
            return self._query(query, rays, *options)
        count = ray_count(*rays)
        return reported(progress, count, "ray", "tracing", lambda: self._query(query, rays, *options))

    def _query(
        self,
        query: Callable[[Rays, Work], tuple[Answer, Stats | None]],
        rays: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike],
        threads: int | None,
        in_flight: int | None,
        lanes: LanesOption,
        stats: bool,
        touching: bool = False,
        max_bytes: int | None = None,
    ) -> Answer | tuple[Answer, Stats]:
        """Check a query's arguments; its answer, with the counters if `stats`."""
        tracer = self._tracer
        usual = threads is None and in_flight is None and stats is False and touching is False
        if usual and max_bytes is None and type(lanes) is str and lanes == "auto":
            at_once: Answer | None = tracer.at_once(query.__name__, *rays)
            if at_once is not None:
                return at_once
            work = USUAL_WORK
        else:
            options = threads, in_flight, lanes, stats, touching, max_bytes
            work = checked_work(tracer.backend, tracer.lacks, *options)
        checked = check_rays(*rays, tracer.backend, tracer.device)
        if checked.library is not NUMPY and query.__name__ in SMOOTH:
            warn_of_lost_gradients(query.__name__, **dict(zip(NAMES, rays, strict=True)))
        answer, counters = query(checked, work) if checked.is_flat else query_shaped(query, checked, work)
        return answer if counters is None else (answer, counters)
