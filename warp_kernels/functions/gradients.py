"""A closest hit whose distance and point have gradients with respect to the ray and the vertices."""

import warp as wp

from wive.warp_kernels.functions.functions import closest_hit
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.tree.handle import HANDLES, KINDS, derive_struct


@wp.struct
class SurfaceHit:
    """t, the point and the triangle hit; infinity, NaN and -1 on a miss."""

    t: wp.float32
    point: wp.vec3
    prim: wp.int32


SurfaceHit64 = derive_struct(
    SurfaceHit, "SurfaceHit64", "A hit in a float64 tree, as `SurfaceHit`.", t=wp.float64, point=wp.vec3d
)
SURFACE_HITS = {"float32": SurfaceHit, "float64": SurfaceHit64}


def make_differentiable_hit(
    accuracy: str, precision: str, differentiable_hit: wp.Function | None = None
) -> wp.Function:
    """The function, with an overload for one more kind of handles (see `make_functions`)."""
    handle_type, hit_type = HANDLES[accuracy, precision], SURFACE_HITS[precision]
    real, vec3 = PRECISIONS[precision].real, PRECISIONS[precision].vec3

    @wp.func
    def differentiable_hit(
        bvh: handle_type,
        vertices: wp.array(dtype=vec3),
        faces: wp.array(dtype=wp.vec3i),
        origin: vec3,
        direction: vec3,
        tmin: real,
        tmax: real,
    ) -> hit_type:
        """The closest hit, with gradients of t and the point with respect to origin, direction and vertices.

        `vertices` and `faces` are the mesh that the tree was built over. The traversal finds the triangle and
        has no gradient; t and the point are then computed from the triangle in the tree's precision, so t may
        differ from `closest_hit`'s in its last digits. Gradients are those of the triangle that is hit; they
        do not include the jump of t when a ray moves past an edge. It takes the same handles as
        `closest_hit`, and returns a `SurfaceHit64` for those of float64 scenes.
        """
        prim = closest_hit(bvh, origin, direction, tmin, tmax).prim
        hit = hit_type()
        hit.t = real(wp.inf)
        hit.point = vec3(real(wp.nan))
        hit.prim = prim
        if prim >= 0:
            face = faces[prim]
            v0 = vertices[face[0]]
            normal = wp.cross(vertices[face[1]] - v0, vertices[face[2]] - v0)
            t = wp.dot(normal, v0 - origin) / wp.dot(normal, direction)
            hit.t = t
            hit.point = origin + t * direction
        return hit

    return differentiable_hit


differentiable_hit = None
for _accuracy, _precision in KINDS:
    differentiable_hit = make_differentiable_hit(_accuracy, _precision, differentiable_hit)
