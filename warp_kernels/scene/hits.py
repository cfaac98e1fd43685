"""Hits on a Warp device: mask, points and normals are computed there."""

# mypy: disable-error-code="untyped-decorator, valid-type, no-redef"

import functools
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp

from wive._internal.arguments import Float32, Int32
from wive.warp_kernels.lanes.precision import PRECISIONS, precision_of

OPTIONS = {"enable_backward": False, "fuse_fp": False}


@dataclass(frozen=True, eq=False, repr=False)
class WarpHits:
    """What `wive.Hits` holds, as Warp arrays: t and prim (n,), uv (n,) vec2, or vec2d in a float64 scene.

    `mesh_on_device` gives vertices (v,) vec3 or vec3d and faces (f,) vec3i on the device of the hits.
    """

    t: Any
    prim: Any
    uv: Any
    vertices: Float32
    faces: Int32
    mesh_on_device: Callable[[], tuple[Any, Any]]

    @property
    def _kernels(self) -> SimpleNamespace:
        return hit_kernels(precision_of(self.t))

    @property
    def mask(self) -> Any:
        """(n,) bool."""
        mask = wp.empty(len(self.prim), dtype=wp.bool, device=self.prim.device)
        wp.launch(self._kernels.mask, len(mask), [self.prim], [mask], device=mask.device)
        return mask

    def points(self) -> Any:
        """(n,) vec3d."""
        points = wp.empty(len(self.prim), dtype=wp.vec3d, device=self.prim.device)
        inputs = [*self.mesh_on_device(), self.prim, self.uv]
        wp.launch(self._kernels.points, len(points), inputs, [points], device=points.device)
        return points

    def normals(self) -> Any:
        """(n,) vec3d."""
        normals = wp.empty(len(self.prim), dtype=wp.vec3d, device=self.prim.device)
        inputs = [*self.mesh_on_device(), self.prim]
        wp.launch(self._kernels.normals, len(normals), inputs, [normals], device=normals.device)
        return normals


@wp.func
def in_double(v: wp.vec3) -> wp.vec3d:
    """The same vector."""
    return wp.vec3d(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))


@wp.func
def in_double(v: wp.vec3d) -> wp.vec3d:  # noqa: D103, F811
    return v


@functools.cache
def hit_kernels(precision: str) -> SimpleNamespace:
    """The kernels for scenes of that precision, compiled together."""
    numbers = PRECISIONS[precision]
    vec2, vec3 = numbers.vec2, numbers.vec3
    module = wp.get_module(f"{__name__}.{precision}")
    wp.set_module_options(OPTIONS, module=module)

    @wp.kernel(module=module)
    def mask(prim: wp.array[wp.int32], mask: wp.array[wp.bool]) -> None:
        i = wp.tid()
        mask[i] = prim[i] >= 0

    @wp.kernel(module=module)
    def points(
        vertices: wp.array[vec3],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        uv: wp.array[vec2],
        points: wp.array[wp.vec3d],
    ) -> None:
        i = wp.tid()
        if prim[i] < 0:
            points[i] = wp.vec3d(wp.float64(wp.nan))
            return
        face = faces[prim[i]]
        u = wp.float64(uv[i][0])
        v = wp.float64(uv[i][1])
        w = wp.float64(1.0) - u - v
        points[i] = (
            w * in_double(vertices[face[0]])
            + u * in_double(vertices[face[1]])
            + v * in_double(vertices[face[2]])
        )

    @wp.kernel(module=module)
    def normals(
        vertices: wp.array[vec3],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        normals: wp.array[wp.vec3d],
    ) -> None:
        i = wp.tid()
        if prim[i] < 0:
            normals[i] = wp.vec3d(wp.float64(wp.nan))
            return
        face = faces[prim[i]]
        v0 = in_double(vertices[face[0]])
        across = wp.cross(in_double(vertices[face[1]]) - v0, in_double(vertices[face[2]]) - v0)
        normals[i] = across / wp.length(across)

    return SimpleNamespace(mask=mask, points=points, normals=normals)
