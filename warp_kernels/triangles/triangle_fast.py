"""The fast triangle test: Moeller and Trumbore 1997.

The operations are those of cpu/traverse/triangle_fast.h, in the same order.
"""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.precision import PRECISIONS, stack_numbers
from wive.warp_kernels.queries.frame import FRAMES, flip_sign

# The numbers that the test keeps of a ray, three each.
ORIGIN = 0
DIRECTION = 3
RAY_NUMBERS = 6


def fast_triangles(
    lanes: SimpleNamespace, blocks: SimpleNamespace, ray_base: int, precision: str, crossings: bool
) -> SimpleNamespace:
    """The test for a lane form, block form and precision; its ray is kept from stack word `ray_base` on.

    crossings: not used, because triangles that share an edge may disagree about a ray through it.
    """
    length: int = lanes.triangles_length
    vector, products = lanes.triangles, lanes.products
    corners, corner, used = blocks.corners, blocks.corner, blocks.used
    edge_of, edges_of = blocks.edge_of, blocks.edges_of
    stack_argument, frame_type = lanes.stack_argument, FRAMES[precision]
    numbers, ray_numbers = PRECISIONS[precision], stack_numbers(lanes, precision, ray_base)
    real, vec3, product = numbers.real, numbers.vec3, numbers.product
    store, load_vector = ray_numbers.store, ray_numbers.load_vector

    @wp.func
    def cross(a: vec3, b: vec3):
        return vec3(
            product(a[1], b[2]) - product(a[2], b[1]),
            product(a[2], b[0]) - product(a[0], b[2]),
            product(a[0], b[1]) - product(a[1], b[0]),
        )

    @wp.func
    def dot(a: vec3, b: vec3):
        return product(a[0], b[0]) + product(a[1], b[1]) + product(a[2], b[2])

    @without_gradient
    @wp.func
    def prepare(ray: frame_type, stack: stack_argument):
        """Keep what the test needs of a ray."""
        for axis in range(3):
            store(stack, ORIGIN + axis, ray.origin[axis])
            store(stack, DIRECTION + axis, ray.direction[axis])

    @wp.func
    def edge_vector(stored: vec3, v0: vec3):
        """The edge from v0 to another corner."""
        return vec3(edge_of(stored[0], v0[0]), edge_of(stored[1], v0[1]), edge_of(stored[2], v0[2]))

    @without_gradient
    @wp.func
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, negative: bool):
        """t, u and v of the block's triangle j, which the ray's line hits."""
        axes = wp.vec3i(0, 1, 2)
        v0 = corner(units, block, 0, j, axes)
        e1 = edge_vector(corner(units, block, 1, j, axes), v0)
        e2 = edge_vector(corner(units, block, 2, j, axes), v0)
        d = load_vector(stack, DIRECTION)
        p = cross(d, e2)
        s = load_vector(stack, ORIGIN) - v0
        q = cross(s, e1)
        det = dot(e1, p)
        size = wp.abs(det)
        t = flip_sign(dot(e2, vec3(q[0] / size, q[1] / size, q[2] / size)), det)
        return vec3(t, flip_sign(dot(s, p), det) / size, flip_sign(dot(d, q), det) / size)

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line hits, one bit each; the second word is not used."""
        o = load_vector(stack, ORIGIN)
        d = load_vector(stack, DIRECTION)
        d0 = vector(d[0])
        d1 = vector(d[1])
        d2 = vector(d[2])
        axes = wp.vec3i(0, 1, 2)
        v0x, v0y, v0z = corners(units, block, lane, 0, axes)
        e1x, e1y, e1z = corners(units, block, lane, 1, axes)
        e2x, e2y, e2z = corners(units, block, lane, 2, axes)
        e1x = edges_of(e1x, v0x)
        e1y = edges_of(e1y, v0y)
        e1z = edges_of(e1z, v0z)
        e2x = edges_of(e2x, v0x)
        e2y = edges_of(e2y, v0y)
        e2z = edges_of(e2z, v0z)
        sx = vector(o[0]) - v0x
        sy = vector(o[1]) - v0y
        sz = vector(o[2]) - v0z
        px = products(d1, e2z) - products(d2, e2y)
        py = products(d2, e2x) - products(d0, e2z)
        pz = products(d0, e2y) - products(d1, e2x)
        qx = products(sy, e1z) - products(sz, e1y)
        qy = products(sz, e1x) - products(sx, e1z)
        qz = products(sx, e1y) - products(sy, e1x)
        det = products(e1x, px) + products(e1y, py) + products(e1z, pz)
        us = products(sx, px) + products(sy, py) + products(sz, pz)
        vs = products(d0, qx) + products(d1, qy) + products(d2, qz)
        hit_mask = wp.uint32(0)
        for i in range(length):
            size = wp.abs(det[i])
            u = flip_sign(us[i], det[i])
            v = flip_sign(vs[i], det[i])
            # A determinant of zero (a ray in the triangle's plane) and NaN (an unused lane) must fail.
            zero = real(0.0)
            if u >= zero and v >= zero and u + v <= size and size > zero:
                hit_mask = hit_mask | wp.uint32(1 << i)
        return wp.vec2ui(used(units, block, lane, hit_mask), wp.uint32(0))

    return SimpleNamespace(prepare=prepare, candidates=candidates, solve=solve)
