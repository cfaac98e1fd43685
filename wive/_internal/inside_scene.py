"""Which points are inside a scene, and the sign of distances: by crossings of rays, or by winding numbers."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wive._internal.host_arrays import host_arrays
from wive._internal.inside import Mask, contains, is_closed
from wive._internal.options import Work
from wive._internal.points import Points
from wive._internal.precision import Floats, real_of
from wive._internal.progress import part
from wive._internal.rays import rays_of_numpy
from wive._internal.tracer import Tracer

SignOption = Literal["crossings", "winding"]
SIGNS = ("crossings", "winding")
# Inside is where the mesh winds round a point more than half.
INSIDE = 0.5
# Whether a mesh is closed is found out for so many points per triangle: that takes as long as some rays.
WORTH_KNOWING = 0.25


def inside_of(tracer: Tracer, faces: NDArray[np.int32], points: Points, sign: SignOption, work: Work) -> Mask:
    """(n,) bool of points in host memory, whether each is inside."""
    bvh = tracer.bvh
    if sign == "winding":
        host_arrays("sign='winding'", points=points.points)
    rows = points.on_host(real_of(bvh.vertices.dtype, bvh.accuracy)).points
    if sign == "winding":
        return np.asarray(np.abs(bvh.winding(rows, work.threads)) > INSIDE)

    def passes(some: NDArray[Any], direction: NDArray[np.float64]) -> tuple[NDArray[Any], None]:
        ways = np.ascontiguousarray(np.broadcast_to(direction.astype(some.dtype, copy=False), some.shape))
        return tracer.count(rays_of_numpy(some, ways, 0.0, np.inf), work)[0], None

    closed = len(rows) > WORTH_KNOWING * len(faces) and bvh.accuracy != "fast" and tracer.closed
    return contains(bvh.bounds, rows, passes, closed)


def signed_distances(
    tracer: Tracer, faces: NDArray[np.int32], points: Points, sign: SignOption, work: Work
) -> Floats:
    """(n,) distances of points in host memory, negative inside."""
    rows = points.on_host(real_of(tracer.bvh.vertices.dtype, tracer.bvh.accuracy))
    with part(0, 0.8):
        distance = tracer.closest(rows, work).distance
    with part(0.8, 1):
        inside = inside_of(tracer, faces, points, sign, work)
    return np.negative(distance, out=distance, where=inside)


def closed_scene(tracer: Tracer, faces: NDArray[np.int32]) -> bool:
    """Whether every edge of the tracer's mesh is in an even number of triangles."""
    return is_closed(tracer.bvh.vertices, faces)
