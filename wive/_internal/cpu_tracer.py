"""Queries and pictures by the compiled core."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.arrays import NUMPY
from wive._internal.distant import Ball, Moved, Traced, moved
from wive._internal.inside_scene import SignOption, closed_scene, inside_of, signed_distances
from wive._internal.options import Work
from wive._internal.picture import Image, Look
from wive._internal.points import Points
from wive._internal.precision import Floats, real_of
from wive._internal.rays import Rays, rays_of_numpy
from wive._internal.wrapping import Wrapping
from wive.all_hits import AllHits, WrappedAllHits
from wive.closest import Closest, WrappedClosest
from wive.geoms import Geoms
from wive.hits import Hits, Stats, WrappedHits, stats_of


class CpuTracer:
    """The tree in host memory, and the kernels of one CPU backend."""

    device = None
    lacks = ("lanes",)
    COMPUTED = ("closed", "_ball")  # kept when read; they follow from the vertices

    def __init__(
        self, bvh: _cpu.Bvh, faces: NDArray[np.int32], backend: str, geoms: Geoms | None = None
    ) -> None:
        """Take the tree; the kernels are looked up by the first query."""
        self.bvh, self.backend, self.geoms = bvh, backend, geoms
        self._faces, self._accuracy, self._real = (
            faces,
            bvh.accuracy,
            real_of(bvh.vertices.dtype, bvh.accuracy),
        )
        self._kernels = _cpu.Kernels(backend)
        self.vertices: Floats = bvh.vertices  # `_cpu.move_part` sets it as well
        self._ready: dict[str, Callable[..., Any]] = {
            "intersect": bvh.intersect_ready,
            "occluded": bvh.occluded_ready,
            "count": bvh.count_ready,
        }

    @property
    def tree(self) -> NoReturn:
        """ValueError: the tree for `wive.warp_kernels` is on a Warp device."""
        raise ValueError(
            f"tree is for scenes with backend 'warp', this one has {self.backend!r}: "
            "make it with device='cpu' or device='cuda:0'"
        )

    def at_once(self, query: str, origins: Any, directions: Any, tmin: Any, tmax: Any) -> Any:
        """The answer with the usual options, if rays are arrays that need no check in Python; else None."""
        ready = self._ready.get(query)
        found = None if ready is None else ready(self._kernels, origins, directions, tmin, tmax)
        if found is None:
            return None
        if query == "intersect":
            t, prim, uv, _ = found
            rays = rays_of_numpy(origins, directions, tmin, tmax)
            mesh = self.vertices, self._faces
            return Hits(t, prim, uv, *mesh, rays, self._accuracy, None, self.geoms)
        return found[0]

    def intersect(self, rays: Rays, work: Work) -> tuple[Hits, Stats | None]:
        """Closest hits."""
        arrays, near = self._traced(rays, work)
        t, prim, uv, steps = self.bvh.intersect(
            self._kernels, *arrays, work.threads, work.in_flight, work.stats
        )
        if near is not None:
            t = near.t(t)
        hits = Hits(t, prim, uv, self.vertices, self._faces, rays, self._accuracy, near, self.geoms)
        if rays.library is not NUMPY:
            hits = WrappedHits(hits, _wrapping(rays))
        return hits, None if steps is None else stats_of(steps, rays.library)

    def occluded(self, rays: Rays, work: Work) -> tuple[Any, Stats | None]:
        """(n,) bool, whether anything is hit."""
        arrays, _ = self._traced(rays, work)
        mask, steps = self.bvh.occluded(self._kernels, *arrays, work.threads, work.in_flight, work.stats)
        library = rays.library
        return library.from_numpy(mask), None if steps is None else stats_of(steps, library)

    def count(self, rays: Rays, work: Work) -> tuple[Any, Stats | None]:
        """(n,) int32, the number of hits."""
        arrays, _ = self._traced(rays, work)
        counts, steps = self.bvh.count(
            self._kernels, *arrays, work.threads, work.in_flight, work.stats, touching=work.touching
        )
        library = rays.library
        return library.from_numpy(counts), None if steps is None else stats_of(steps, library)

    def intersect_all(self, rays: Rays, work: Work) -> tuple[AllHits, Stats | None]:
        """All hits."""
        arrays, near = self._traced(rays, work)
        options = work.threads, work.in_flight, work.stats, work.touching
        found = self.bvh.intersect_all(self._kernels, *arrays, *options, max_bytes=work.max_bytes)
        offsets, t, prim, uv, steps = found
        mesh = self.vertices, self._faces, self.geoms
        hits = AllHits(offsets, t, prim, uv, *mesh)
        if near is not None:
            hits = AllHits(offsets, near.t(t, hits.ray), prim, uv, *mesh)
        if rays.library is not NUMPY:
            hits = WrappedAllHits(hits, _wrapping(rays))
        return hits, None if steps is None else stats_of(steps, rays.library)

    def closest(self, points: Points, work: Work) -> Closest:
        """The surface's closest points."""
        arrays = points.numpy(self._real)
        found = self.bvh.closest(self._kernels, *arrays, work.threads)
        closest = Closest(*found, self.vertices, self._faces, self.geoms)
        if points.library is NUMPY and points.leading is None:
            return closest
        return WrappedClosest(closest, Wrapping(points.library, "cpu", points.answer))

    def inside(self, points: Points, sign: SignOption, work: Work) -> Any:
        """(n,) bool, whether each point is inside."""
        return points.answer(inside_of(self, self._faces, points, sign, work))

    def signed_distance(self, points: Points, sign: SignOption, work: Work) -> Any:
        """(n,) distances, negative inside."""
        return points.answer(signed_distances(self, self._faces, points, sign, work))

    @functools.cached_property
    def closed(self) -> bool:
        """Whether every edge is in an even number of triangles."""
        return closed_scene(self, self._faces)

    def refitted(self, vertices: Floats, threads: int) -> CpuTracer:
        """A tracer of moved vertices, as many as before."""
        return CpuTracer(self.bvh.refitted(vertices, threads), self._faces, self.backend, self.geoms)

    def rows_renderer(self, camera: Image, image: Image, look: Look) -> Callable[[int, int], int]:
        """A function that renders rows [begin, end) into `image` and returns how many rays it traced.

        Its first call checks the mesh, whose arrays the caller may have changed since the tree was built.
        """
        what = look.spp, look.bounces, look.albedo, look.seed
        unchecked = True

        def render_rows(begin: int, end: int) -> int:
            nonlocal unchecked
            check, unchecked = unchecked, False
            return self.bvh.render_rows(
                self._kernels,
                camera,
                image,
                begin,
                end,
                *what,
                threads=look.threads,
                check=check,
                colours=look.colours,
                light=look.light,
            )

        return render_rows

    @functools.cached_property
    def _ball(self) -> Ball:
        return Ball.around(self.bvh.bounds, self.bvh.far_distance)

    def _traced(self, rays: Rays, work: Work) -> tuple[Traced, Moved | None]:
        """The rays as the core takes them, and how far some were moved."""
        arrays = rays.numpy(self._real)
        near = moved(rays, arrays, self._real, self._ball, work.threads)
        return (arrays, None) if near is None else (near.arrays, near)


def _wrapping(rays: Rays) -> Wrapping:
    return Wrapping(rays.library, "cpu", rays.library.from_numpy)
