"""A hit whose distance and point have gradients with respect to the ray and the triangle's vertices."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import warp as wp

from wive.warp_kernels.functions.functions import closest_hit
from wive.warp_kernels.tree.handle import Bvh, ExactBvh, FastBvh


@wp.struct
class SurfaceHit:
    """t and the point hit, infinity and NaN where nothing is; prim is -1 then."""

    t: wp.float32
    point: wp.vec3
    prim: wp.int32


@wp.func
def intersect_plane(origin: wp.vec3, direction: wp.vec3, v0: wp.vec3, v1: wp.vec3, v2: wp.vec3):
    """t at which a ray meets the plane of a triangle."""
    normal = wp.cross(v1 - v0, v2 - v0)
    return wp.dot(normal, v0 - origin) / wp.dot(normal, direction)


@wp.func
def on_surface(
    prim: int,
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    origin: wp.vec3,
    direction: wp.vec3,
) -> SurfaceHit:
    """The hit of a ray on triangle prim, taken again from its vertices."""
    hit = SurfaceHit()
    hit.t = wp.inf
    hit.point = wp.vec3(wp.nan, wp.nan, wp.nan)
    hit.prim = prim
    if prim >= 0:
        face = faces[prim]
        t = intersect_plane(origin, direction, vertices[face[0]], vertices[face[1]], vertices[face[2]])
        hit.t = t
        hit.point = origin + t * direction
    return hit


@wp.func
def differentiable_hit(
    bvh: Bvh,
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    origin: wp.vec3,
    direction: wp.vec3,
    tmin: float,
    tmax: float,
) -> SurfaceHit:
    """The closest hit, with gradients of t and the point with respect to origin, direction and vertices.

    `vertices` and `faces` are the mesh that the tree was built over. The traversal finds the triangle and has
    no gradient; t and the point are then taken from the triangle in float, so t may differ from
    `closest_hit`'s in its last digits. Gradients are those of the triangle that is hit: they don't see a ray
    slip off an edge. It takes the handle of a watertight tree (`Bvh`), a fast one (`FastBvh`)
    or an exact one (`ExactBvh`).
    """
    hit = closest_hit(bvh, origin, direction, tmin, tmax)
    return on_surface(hit.prim, vertices, faces, origin, direction)


@wp.func
def differentiable_hit(  # noqa: D103, F811
    bvh: FastBvh,
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    origin: wp.vec3,
    direction: wp.vec3,
    tmin: float,
    tmax: float,
) -> SurfaceHit:
    hit = closest_hit(bvh, origin, direction, tmin, tmax)
    return on_surface(hit.prim, vertices, faces, origin, direction)


@wp.func
def differentiable_hit(  # noqa: D103, F811
    bvh: ExactBvh,
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    origin: wp.vec3,
    direction: wp.vec3,
    tmin: float,
    tmax: float,
) -> SurfaceHit:
    hit = closest_hit(bvh, origin, direction, tmin, tmax)
    return on_surface(hit.prim, vertices, faces, origin, direction)
