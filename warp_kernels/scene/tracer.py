"""Queries and pictures on a Warp device, on the stream of the library that the rays came in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.arrays import NUMPY
from wive._internal.distant import Ball, Moved, moved
from wive._internal.inside import DIRECTIONS
from wive._internal.inside_scene import SignOption, closed_scene, inside_of, signed_distances
from wive._internal.options import Lanes, Work
from wive._internal.picture import Image, Look
from wive._internal.points import Points
from wive._internal.precision import Floats, real_of
from wive._internal.rays import Rays
from wive._internal.wrapping import Wrapping
from wive.all_hits import AllHits, WrappedAllHits
from wive.closest import Closest, WrappedClosest
from wive.geoms import Geoms, one_geom
from wive.hits import Hits, Stats, WrappedHits
from wive.warp_kernels import (
    launch_all,
    launch_any,
    launch_closest,
    launch_closest_points,
    launch_count,
    scan_counts,
    upload,
)
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.lanes.warps import expected_lanes
from wive.warp_kernels.scene.hits import WarpAllHits, WarpClosest, WarpHits
from wive.warp_kernels.scene.inside import negate, odd
from wive.warp_kernels.scene.memory import expect_hits_fit, memory_errors
from wive.warp_kernels.scene.rays import RayLoader, WarpRays
from wive.warp_kernels.tree.quiet import launch
from wive.warp_kernels.tree.tree import check_memory

# For fewer rays eight threads per ray keep a GPU busy and return sooner; for more, one thread per ray traces
# more rays per second. The two are equal at this size on an H200, docs/warp.md.
EIGHT_THREADS_BELOW = 32_768


def choose_lanes(lanes: Lanes | None, count: int, on_cuda: bool) -> Lanes:
    """Lanes of a node per thread; None is the better choice for a batch of `count` rays."""
    if lanes is not None:
        chosen: Lanes = expected_lanes(lanes)
        return chosen
    return 1 if on_cuda and count < EIGHT_THREADS_BELOW else 8


class WarpTracer:
    """The tree and the mesh on a device, and the queries that `wive.Scene` answers with them."""

    backend = "warp"
    lacks = ("threads", "in_flight")

    def __init__(
        self, bvh: _cpu.Bvh, faces: NDArray[np.int32], device: str, geoms: Geoms | None = None
    ) -> None:
        """Copy the tree to the device; `upload` waits until it is there, since queries may use any stream."""
        self.bvh, self.device, self.geoms = bvh, device, geoms
        self.vertices, self.faces = bvh.vertices, faces
        self.accuracy, self.precision = bvh.accuracy, bvh.precision
        self._numbers = PRECISIONS[bvh.precision]
        with memory_errors():
            self.loader = RayLoader(device, real_of(bvh.vertices.dtype, bvh.accuracy))
            self.tree = upload(bvh, device)

    @functools.cached_property
    def mesh(self) -> tuple[Any, Any]:
        """Vertices (v,) vec3 or vec3d and faces (f,) vec3i on the device, for points, normals and bounds.

        Copied when first used, and waited for: later uses may be on any stream. On the host they share the
        scene's memory. RuntimeError if a graph is being captured, since nothing can wait then.
        """
        vertices, faces = self._copied(
            "points, normals, error_bound and spawn copy the mesh",
            (self.vertices, self._numbers.vec3),
            (self.faces, wp.vec3i),
        )
        return vertices, faces

    @functools.cached_property
    def first_faces(self) -> Any:
        """(g+1,) int32 on the device: the first triangle of each mesh, and the number of all; as `mesh`."""
        geoms = self.geoms or one_geom(len(self.faces), len(self.vertices))
        (first_faces,) = self._copied(
            "geom and geom_prim copy the numbers of the meshes", (geoms.faces, wp.int32)
        )
        return first_faces

    def _copied(self, what: str, *arrays: tuple[NDArray[Any], Any]) -> list[Any]:
        """NumPy's arrays as Warp's of these dtypes, once they are on the device."""
        stream = wp.get_stream(self.device) if self.device != "cpu" else None
        if stream is not None and stream.is_capturing:
            raise RuntimeError(
                f"{what} to the device when first used: use one of them once before the graph is captured"
            )
        copies = [wp.array(array, dtype=dtype, device=self.device, copy=False) for array, dtype in arrays]
        if stream is not None:
            wp.synchronize_stream(stream)
        return copies

    def at_once(self, query: str, origins: Any, directions: Any, tmin: Any, tmax: Any) -> None:
        """None: all arrays are checked in Python."""

    def intersect(self, rays: Rays, work: Work) -> tuple[Hits, Stats | None]:
        """Closest hits."""
        with rays.library.on_stream(self.device), memory_errors():
            loaded, near = self._load(rays)
            t, prim, uv = self._outputs(len(loaded))
            steps = self._steps(len(loaded), work)
            lanes = self._lanes(work, loaded)
            launch_closest(self.tree, *_arrays(loaded), t, prim, uv, stats=steps, lanes=lanes)
            if rays.library is NUMPY:
                check_memory(self.tree)
                found = t.numpy() if near is None else near.t(t.numpy())
                arrays = found, prim.numpy(), uv.numpy(), self.vertices, self.faces
                return Hits(*arrays, rays, self.accuracy, near, self.geoms), _numpy_stats(steps)
            hits = WarpHits(self, t, prim, uv, loaded)
            return WrappedHits(hits, self._wrapping(rays)), _stats(steps, rays)

    def occluded(self, rays: Rays, work: Work) -> tuple[Any, Stats | None]:
        """(n,) bool, whether anything is hit."""
        with rays.library.on_stream(self.device), memory_errors():
            loaded, _ = self._load(rays)
            mask = wp.empty(len(loaded), dtype=wp.bool, device=self.device)
            steps = self._steps(len(loaded), work)
            launch_any(self.tree, *_arrays(loaded), mask, stats=steps, lanes=self._lanes(work, loaded))
            return self._returned(mask, steps, rays)

    def count(self, rays: Rays, work: Work) -> tuple[Any, Stats | None]:
        """(n,) int32, the number of hits."""
        with rays.library.on_stream(self.device), memory_errors():
            counts, steps = self._count(self._load(rays)[0], work)
            return self._returned(counts, steps, rays)

    def intersect_all(self, rays: Rays, work: Work) -> tuple[AllHits, Stats | None]:
        """All hits: one pass counts them, which makes room for the pass that lists them."""
        with rays.library.on_stream(self.device), memory_errors():
            loaded, near = self._load(rays)
            counts, steps = self._count(loaded, work)
            offsets = scan_counts(counts)
            total = int(offsets[-1:].numpy()[0])
            expect_hits_fit(total, self.precision, self.device, work.max_bytes)
            t, prim, uv = self._outputs(total)
            lanes = self._lanes(work, loaded)
            launch_all(
                self.tree,
                *_arrays(loaded),
                counts,
                offsets,
                t,
                prim,
                uv,
                touching=work.touching,
                lanes=lanes,
            )
            if rays.library is NUMPY:
                check_memory(self.tree)
                arrays = offsets.numpy(), t.numpy(), prim.numpy(), uv.numpy()
                mesh = self.vertices, self.faces, self.geoms
                every = AllHits(*arrays, *mesh)
                if near is not None:
                    farther = near.t(every.t, every.ray)
                    every = AllHits(arrays[0], farther, arrays[2], arrays[3], *mesh)
                return every, _numpy_stats(steps)
            hits = WarpAllHits(self, offsets, t, prim, uv)
            return WrappedAllHits(hits, self._wrapping(rays)), _stats(steps, rays)

    def closest(self, points: Points, work: Work) -> Closest:
        """The surface's closest points."""
        library = points.library
        with library.on_stream(self.device), memory_errors():
            rows, most = self.loader.points(points)
            distance, prim, uv = self._outputs(len(rows))
            launch_closest_points(self.tree, rows, most, distance, prim, uv)
            if library is not NUMPY:
                home = WarpClosest(self, distance, prim, uv)
                return WrappedClosest(home, Wrapping(library, self.device, _FromWarp(points)))
            check_memory(self.tree)
            found = distance.numpy(), prim.numpy(), uv.numpy()
            closest = Closest(*found, self.vertices, self.faces, self.geoms)
            if points.leading is None:
                return closest
            return WrappedClosest(closest, Wrapping(library, self.device, points.answer))

    def inside(self, points: Points, sign: SignOption, work: Work) -> Any:
        """(n,) bool, whether each point is inside; of arrays on the device one ray decides."""
        if points.library is NUMPY or sign == "winding":
            return points.answer(inside_of(self, self.faces, points, sign, work))
        with points.library.on_stream(self.device), memory_errors():
            rows, _ = self.loader.points(points)
            return _FromWarp(points)(self._inside(rows))

    def signed_distance(self, points: Points, sign: SignOption, work: Work) -> Any:
        """(n,) distances, negative inside."""
        if points.library is NUMPY or sign == "winding":
            return points.answer(signed_distances(self, self.faces, points, sign, work))
        with points.library.on_stream(self.device), memory_errors():
            rows, most = self.loader.points(points)
            distance, prim, uv = self._outputs(len(rows))
            launch_closest_points(self.tree, rows, most, distance, prim, uv)
            launch(negate, len(rows), [self._inside(rows)], [distance], device=self.device, record_tape=False)
            return _FromWarp(points)(distance)

    @functools.cached_property
    def closed(self) -> bool:
        """Whether every edge is in an even number of triangles."""
        return closed_scene(self, self.faces)

    def _inside(self, rows: Any) -> Any:
        """(n,) bool of points (n,) vec3: whether a ray crosses the surface an odd number of times."""
        counts = wp.empty(len(rows), dtype=wp.int32, device=self.device)
        inside = wp.empty(len(rows), dtype=wp.bool, device=self.device)
        lanes = choose_lanes(None, len(rows), self.device != "cpu")
        launch_count(self.tree, *self.loader.rays_along(rows, DIRECTIONS[0]), counts, lanes=lanes)
        launch(odd, len(rows), [counts], [inside], device=self.device, record_tape=False)
        return inside

    def refitted(self, vertices: Floats, threads: int) -> WarpTracer:
        """A tracer of moved vertices, as many as before."""
        return WarpTracer(self.bvh.refitted(vertices, threads), self.faces, self.device, self.geoms)

    def rows_renderer(self, camera: Image, image: Image, look: Look) -> Callable[[int, int], int]:
        """A function that renders rows [begin, end) into `image` and returns how many rays it traced."""
        from wive.warp_kernels.scene.render import PictureRenderer

        with memory_errors():
            renderer = PictureRenderer(self, camera, image, look)

        def render_rows(begin: int, end: int) -> int:
            with memory_errors():
                rays: int = renderer.render_rows(begin, end)
            return rays

        return render_rows

    def _count(self, rays: WarpRays, work: Work) -> tuple[Any, Any]:
        counts = wp.empty(len(rays), dtype=wp.int32, device=self.device)
        steps = self._steps(len(rays), work)
        lanes = self._lanes(work, rays)
        launch_count(self.tree, *_arrays(rays), counts, stats=steps, touching=work.touching, lanes=lanes)
        return counts, steps

    def _returned(self, output: Any, steps: Any, rays: Rays) -> tuple[Any, Stats | None]:
        if rays.library is NUMPY:
            check_memory(self.tree)
            return output.numpy(), _numpy_stats(steps)
        return rays.library.from_warp(output), _stats(steps, rays)

    def _load(self, rays: Rays) -> tuple[WarpRays, Moved | None]:
        """The rays on the device, and how far some were moved: NumPy's only, others are not converted."""
        if rays.library is not NUMPY:
            return self.loader.from_device(rays), None
        arrays = rays.numpy(self.loader.numbers)
        near = moved(rays, arrays, self.loader.numbers, self._ball)
        return self.loader.from_numpy(rays, arrays if near is None else near.arrays), near

    @functools.cached_property
    def _ball(self) -> Ball:
        return Ball.around(self.bvh.bounds, self.bvh.far_distance)

    def _lanes(self, work: Work, rays: WarpRays) -> Lanes:
        return choose_lanes(work.lanes, len(rays), self.device != "cpu")

    def _outputs(self, count: int) -> tuple[Any, Any, Any]:
        t = wp.empty(count, dtype=self._numbers.real, device=self.device)
        prim = wp.empty(count, dtype=wp.int32, device=self.device)
        return t, prim, wp.empty(count, dtype=self._numbers.vec2, device=self.device)

    def _steps(self, count: int, work: Work) -> Any:
        return wp.empty(count, dtype=wp.vec3i, device=self.device) if work.stats else None

    def _wrapping(self, rays: Rays) -> Wrapping:
        return Wrapping(rays.library, self.device, rays.library.from_warp)


class _FromWarp:
    """Warp's arrays (n,...) as those of the points' library, in their shape."""

    def __init__(self, points: Points) -> None:
        self._library, self._shaped = points.library, points.shaped()

    def __call__(self, array: Any) -> Any:
        return self._shaped(self._library.from_warp(array))


def _arrays(rays: WarpRays) -> tuple[Any, Any, Any, Any]:
    return rays.origins, rays.directions, rays.tmin, rays.tmax


def _numpy_stats(steps: Any) -> Stats | None:
    return None if steps is None else Stats(*steps.numpy().T)


def _stats(steps: Any, rays: Rays) -> Stats | None:
    """The columns of (n,) vec3i as three arrays of the library that the rays came in."""
    if steps is None:
        return None
    table = wp.array(ptr=steps.ptr, dtype=wp.int32, shape=(len(steps), 3), device=steps.device, copy=False)
    return Stats(*(rays.library.from_warp(table[:, column].contiguous()) for column in range(3)))
