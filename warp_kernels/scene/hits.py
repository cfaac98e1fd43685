"""Hits on a Warp device: masks, points and the like are computed there when used.

`wive.hits.WrappedHits` and `wive.all_hits.WrappedAllHits` call these on the stream of the user's library.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp
from numpy.typing import ArrayLike

from wive._internal.gradients import warn_of_lost_gradients
from wive._internal.spawn import ACCURACIES
from wive.all_hits import row_of
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.scene.geoms import number_geoms, number_within_geoms
from wive.warp_kernels.scene.memory import memory_errors
from wive.warp_kernels.scene.rays import WarpRays, as_vectors
from wive.warp_kernels.scene.sides import side_kernels
from wive.warp_kernels.scene.spawn import bound_constants, bounds_kernel, spawn_constants, spawn_kernel
from wive.warp_kernels.scene.surfaces import count_hits, hit_kernels, number_rays
from wive.warp_kernels.tree.quiet import launch

if TYPE_CHECKING:
    from wive.warp_kernels.scene.tracer import WarpTracer


class WarpHits:
    """The arrays of `wive.Hits` as Warp's: t and prim (n,), uv (n,) vec2, or vec2d in a float64 scene."""

    def __init__(self, tracer: WarpTracer, t: Any, prim: Any, uv: Any, rays: WarpRays | None = None) -> None:
        """Keep the arrays; `rays` are for `error_bound`."""
        self.t, self.prim, self.uv = t, prim, uv
        self.vertices, self.faces = tracer.vertices, tracer.faces
        self._tracer, self._rays = tracer, rays

    @property
    def mask(self) -> Any:
        """(n,) bool."""
        return self._computed(hit_kernels(self._tracer.precision).mask, wp.bool, [self.prim])

    @property
    def geom(self) -> Any:
        """(n,) int32."""
        return self._computed(number_geoms, wp.int32, [self._tracer.first_faces, self.prim])

    @property
    def geom_prim(self) -> Any:
        """(n,) int32."""
        return self._computed(number_within_geoms, wp.int32, [self._tracer.first_faces, self.prim])

    def points(self) -> Any:
        """(n,) vec3d."""
        inputs = [*self._tracer.mesh, self.prim, self.uv]
        return self._computed(hit_kernels(self._tracer.precision).points, wp.vec3d, inputs)

    def normals(self) -> Any:
        """(n,) vec3d."""
        inputs = [*self._tracer.mesh, self.prim]
        return self._computed(hit_kernels(self._tracer.precision).normals, wp.vec3d, inputs)

    @property
    def error_bound(self) -> Any:
        """(n,) float64."""
        assert self._rays is not None
        precision, rays = self._tracer.precision, [self._rays.origins, self._rays.directions]
        inputs = [*self._tracer.mesh, self.prim, self.t, *rays, bound_constants(precision)]
        return self._computed(bounds_kernel(precision), wp.float64, inputs)

    def spawn(self, directions: ArrayLike) -> Any:
        """(n,) vec3, or vec3d in a float64 scene."""
        precision, accuracy = self._tracer.precision, ACCURACIES.index(self._tracer.accuracy)
        rows = self._tracer.loader.directions(directions, len(self.prim))
        inputs = [*self._tracer.mesh, self.prim, self.uv, rows, accuracy, spawn_constants(precision)]
        return self._computed(spawn_kernel(precision), PRECISIONS[precision].vec3, inputs)

    @property
    def front(self) -> Any:
        """(n,) bool."""
        inputs = [*self._tracer.mesh, self.prim, self._directions()]
        return self._computed(side_kernels(self._tracer.precision).front, wp.bool, inputs)

    def cosines(self) -> Any:
        """(n,) float64."""
        inputs = [self.normals(), self._directions()]
        return self._computed(side_kernels(self._tracer.precision).cosines, wp.float64, inputs)

    def interpolate(self, vertex_values: ArrayLike) -> Any:
        """(n,) or (n,k) float32 or float64; (n,) vec2 or vec3 if k is 2 or 3."""
        warn_of_lost_gradients("interpolate", vertex_values=vertex_values)
        with memory_errors():
            values = self._tracer.loader.vertex_values(vertex_values, len(self.vertices))
            rows = values if values.ndim == 2 else values.reshape((-1, 1))
            answer = wp.empty((len(self.prim), rows.shape[1]), dtype=rows.dtype, device=self.prim.device)
        inputs = [rows, self._tracer.mesh[1], self.prim, self.uv]
        kernel = side_kernels(self._tracer.precision).interpolate
        launch(kernel, answer.shape, inputs, [answer], device=answer.device)
        return answer.flatten() if values.ndim == 1 else as_vectors(answer)

    def _directions(self) -> Any:
        assert self._rays is not None
        return self._rays.directions

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.t)

    def _computed(self, kernel: Any, dtype: Any, inputs: list[Any]) -> Any:
        """What the kernel writes, one value per hit."""
        with memory_errors():
            output = wp.empty(len(self.prim), dtype=dtype, device=self.prim.device)
        launch(kernel, len(output), inputs, [output], device=output.device)
        return output


class WarpClosest(WarpHits):
    """The arrays of `wive.Closest` as Warp's: distance and prim (n,), uv (n,) vec2 or vec2d."""

    def __init__(self, tracer: WarpTracer, distance: Any, prim: Any, uv: Any) -> None:
        """Keep the arrays."""
        super().__init__(tracer, distance, prim, uv)
        self.distance = distance


class WarpAllHits(WarpHits):
    """The arrays of `wive.AllHits` as Warp's: offsets (n+1,) int64, t and prim (h,), uv (h,) vec2."""

    def __init__(self, tracer: WarpTracer, offsets: Any, t: Any, prim: Any, uv: Any) -> None:
        """Keep the arrays."""
        super().__init__(tracer, t, prim, uv)
        self.offsets = offsets

    @property
    def counts(self) -> Any:
        """(n,) int32."""
        counts = wp.empty(len(self), dtype=wp.int32, device=self.offsets.device)
        launch(count_hits, len(counts), [self.offsets], [counts], device=counts.device)
        return counts

    @property
    def ray(self) -> Any:
        """(h,) int64."""
        ray = wp.empty(len(self.t), dtype=wp.int64, device=self.offsets.device)
        launch(number_rays, len(self), [self.offsets], [ray], device=ray.device)
        return ray

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> WarpAllHits:
        """The hits of ray i; waits for the device."""
        row = row_of(i, len(self))
        first, last = (int(offset) for offset in self.offsets[row : row + 2].numpy())
        offsets = wp.array([0, last - first], dtype=wp.int64, device=self.offsets.device)
        rows = (_part(array, first, last) for array in (self.t, self.prim, self.uv))
        return WarpAllHits(self._tracer, offsets, *rows)


def _part(array: Any, first: int, last: int) -> Any:
    """Rows of an array, over the same memory; Warp refuses slices of no rows."""
    return array[first:last] if last > first else wp.empty(0, dtype=array.dtype, device=array.device)
