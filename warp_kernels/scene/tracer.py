"""Queries on a Warp device: outputs made, kernels launched, on the stream of whoever asked."""

import functools
from typing import Any

import warp as wp

from wive import _cpu
from wive._internal.arguments import Float32, Int32, Lanes
from wive._internal.arrays import NUMPY
from wive._internal.rays import Rays
from wive.all_hits import AllHits, WrappedAllHits
from wive.hits import Hits, Stats, WrappedHits
from wive.warp_kernels import (
    MOST_HITS,
    check,
    launch_all,
    launch_any,
    launch_closest,
    launch_count,
    scan_counts,
    upload,
)
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.scene.all_hits import WarpAllHits
from wive.warp_kernels.scene.rays import RayLoader, WarpRays
from wive.warp_kernels.scene.spawn import WarpClosestHits

# Below it eight threads a ray keep a GPU busy and answer sooner; above it one thread a ray answers more.
# An estimate from a prototype; `python -m bench latency --lanes 1,8` on a GPU measures it.
EIGHT_THREADS_BELOW = 32_768


def choose_lanes(asked: Lanes | None, count: int, on_cuda: bool) -> Lanes:
    """Lanes of a node that one thread owns; None is the better for a batch of `count` rays."""
    if asked is not None:
        return asked
    return 1 if on_cuda and count < EIGHT_THREADS_BELOW else 8


class WarpTracer:
    """The tree on a device, and the queries that `wive.Scene` answers with it."""

    def __init__(self, bvh: _cpu.Bvh, vertices: Float32, faces: Int32, device: str) -> None:
        """Copy the tree to the device."""
        self.tree = upload(bvh, device)
        self.device = device
        self._vertices, self._faces = vertices, faces
        self._accuracy = bvh.accuracy
        self._numbers = PRECISIONS[self.tree.precision]
        self._loader = RayLoader(device, self.tree.precision)

    def intersect(self, rays: Rays, lanes: Lanes | None, stats: bool) -> tuple[Hits, Stats | None]:
        """Closest hits, in arrays of the library that the rays came in."""
        with rays.library.on_stream(self.device):
            loaded = self._load(rays)
            t, prim, uv = self._outputs(len(loaded))
            counts = self._counts(len(loaded), stats)
            launch_closest(
                self.tree, *_arrays(loaded), t, prim, uv, stats=counts, lanes=self._lanes(lanes, loaded)
            )
            if rays.library is NUMPY:
                check(self.tree)
                found = t.numpy(), prim.numpy(), uv.numpy()
                hits = Hits(*found, self._vertices, self._faces, rays, self._accuracy)
                return hits, _numpy_stats(counts)
            found = t, prim, uv
            inner = WarpClosestHits(*found, self._vertices, self._faces, self.mesh, loaded, self._accuracy)
            return WrappedHits(inner, rays.library.from_warp), _stats(counts, rays)

    def occluded(self, rays: Rays, lanes: Lanes | None, stats: bool) -> tuple[Any, Stats | None]:
        """Whether anything is hit, in an array of the library that the rays came in."""
        with rays.library.on_stream(self.device):
            loaded = self._load(rays)
            mask = wp.empty(len(loaded), dtype=wp.bool, device=self.device)
            counts = self._counts(len(loaded), stats)
            launch_any(self.tree, *_arrays(loaded), mask, stats=counts, lanes=self._lanes(lanes, loaded))
            if rays.library is NUMPY:
                check(self.tree)
                return mask.numpy(), _numpy_stats(counts)
            return rays.library.from_warp(mask), _stats(counts, rays)

    def count(self, rays: Rays, lanes: Lanes | None, stats: bool) -> tuple[Any, Stats | None]:
        """How many hits each ray has, in an array of the library that the rays came in."""
        with rays.library.on_stream(self.device):
            counts, steps = self._count(self._load(rays), lanes, stats)
            if rays.library is NUMPY:
                check(self.tree)
                return counts.numpy(), _numpy_stats(steps)
            return rays.library.from_warp(counts), _stats(steps, rays)

    def intersect_all(self, rays: Rays, lanes: Lanes | None, stats: bool) -> tuple[AllHits, Stats | None]:
        """All hits: one pass counts them, which makes room for the pass that lists them."""
        with rays.library.on_stream(self.device):
            loaded = self._load(rays)
            counts, steps = self._count(loaded, lanes, stats)
            offsets = scan_counts(counts)
            total = int(offsets[-1:].numpy()[0])
            if total > MOST_HITS:
                raise MemoryError(
                    f"{total} hits are more than a Warp array holds ({MOST_HITS}): "
                    "split the rays into batches"
                )
            t, prim, uv = self._outputs(total)
            chosen = self._lanes(lanes, loaded)
            launch_all(self.tree, *_arrays(loaded), counts, offsets, t, prim, uv, lanes=chosen)
            if rays.library is NUMPY:
                check(self.tree)
                arrays = offsets.numpy(), t.numpy(), prim.numpy(), uv.numpy()
                return AllHits(*arrays, self._vertices, self._faces), _numpy_stats(steps)
            inner = WarpAllHits(t, prim, uv, self._vertices, self._faces, self.mesh, offsets)
            return WrappedAllHits(inner, rays.library.from_warp), _stats(steps, rays)

    def _count(self, rays: WarpRays, lanes: Lanes | None, stats: bool) -> tuple[Any, Any]:
        counts = wp.empty(len(rays), dtype=wp.int32, device=self.device)
        steps = self._counts(len(rays), stats)
        launch_count(self.tree, *_arrays(rays), counts, stats=steps, lanes=self._lanes(lanes, rays))
        return counts, steps

    @functools.cached_property
    def _mesh(self) -> tuple[Any, Any]:
        vertices = wp.array(self._vertices, dtype=self._numbers.vec3, device=self.device, copy=False)
        return vertices, wp.array(self._faces, dtype=wp.vec3i, device=self.device, copy=False)

    def mesh(self) -> tuple[Any, Any]:
        """Vertices (v,) vec3 or vec3d and faces (f,) vec3i on the device; copied when first asked for."""
        return self._mesh

    def _load(self, rays: Rays) -> WarpRays:
        return self._loader.from_numpy(rays) if rays.library is NUMPY else self._loader.from_device(rays)

    def _lanes(self, asked: Lanes | None, rays: WarpRays) -> Lanes:
        return choose_lanes(asked, len(rays), self.device != "cpu")

    def _outputs(self, count: int) -> tuple[Any, Any, Any]:
        t = wp.empty(count, dtype=self._numbers.real, device=self.device)
        prim = wp.empty(count, dtype=wp.int32, device=self.device)
        return t, prim, wp.empty(count, dtype=self._numbers.vec2, device=self.device)

    def _counts(self, count: int, stats: bool) -> Any:
        return wp.empty(count, dtype=wp.vec3i, device=self.device) if stats else None


def _arrays(rays: WarpRays) -> tuple[Any, Any, Any, Any]:
    return rays.origins, rays.directions, rays.tmin, rays.tmax


def _numpy_stats(counts: Any) -> Stats | None:
    return None if counts is None else Stats(*counts.numpy().T)


def _stats(counts: Any, rays: Rays) -> Stats | None:
    """The columns of (n,) vec3i as three arrays of the library that the rays came in."""
    if counts is None:
        return None
    table = wp.array(ptr=counts.ptr, dtype=wp.int32, shape=(len(counts), 3), device=counts.device, copy=False)
    return Stats(*(rays.library.from_warp(table[:, column].contiguous()) for column in range(3)))
