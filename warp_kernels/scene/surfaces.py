"""Points and normals of triangles hit, computed on a Warp device in double."""

# mypy: disable-error-code="untyped-decorator, valid-type"

import functools
from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.precision import PRECISIONS, in_double

OPTIONS = {"enable_backward": False, "fuse_fp": False}


@wp.func
def vertices_of(faces: wp.array[wp.vec3i], prim: int, vertex_count: int) -> wp.vec3i:
    """A triangle's vertices; -1 if there is no such triangle or vertex.

    On the host the arrays are the caller's, and another thread may write to them.
    """
    none = wp.vec3i(-1, -1, -1)
    if prim < 0 or prim >= faces.shape[0]:
        return none
    face = faces[prim]
    if wp.min(face) < 0 or wp.max(face) >= vertex_count:
        return none
    return face


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
        face = vertices_of(faces, prim[i], vertices.shape[0])
        if face[0] < 0:
            points[i] = wp.vec3d(wp.float64(wp.nan))
            return
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
        face = vertices_of(faces, prim[i], vertices.shape[0])
        if face[0] < 0:
            normals[i] = wp.vec3d(wp.float64(wp.nan))
            return
        v0 = in_double(vertices[face[0]])
        across = wp.cross(in_double(vertices[face[1]]) - v0, in_double(vertices[face[2]]) - v0)
        normals[i] = across / wp.length(across)

    return SimpleNamespace(mask=mask, points=points, normals=normals)


@wp.kernel(enable_backward=False)
def count_hits(offsets: wp.array[wp.int64], counts: wp.array[wp.int32]) -> None:
    """The number of hits per ray, of dimension (n,)."""
    i = wp.tid()
    counts[i] = wp.int32(offsets[i + 1] - offsets[i])


@wp.kernel(enable_backward=False)
def number_rays(offsets: wp.array[wp.int64], ray: wp.array[wp.int64]) -> None:
    """The ray of each hit, of dimension (n,)."""
    i = wp.tid()
    for row in range(wp.int32(offsets[i]), wp.int32(offsets[i + 1])):
        ray[row] = wp.int64(i)
