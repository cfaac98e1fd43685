"""Moeller and Trumbore 1997 on the triangles of a block, operation by operation as cpu/triangle_fast.h."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.frame import RayFrame, flip_sign
from wive.warp_kernels.lanes import load_float, product, without_gradient

# What the test keeps of a ray behind the stack's entries: origin and direction.
KEPT_WORDS = 6


@wp.func
def _cross(a: wp.vec3, b: wp.vec3):
    return wp.vec3(
        product(a[1], b[2]) - product(a[2], b[1]),
        product(a[2], b[0]) - product(a[0], b[2]),
        product(a[0], b[1]) - product(a[1], b[0]),
    )


@wp.func
def _dot(a: wp.vec3, b: wp.vec3):
    return product(a[0], b[0]) + product(a[1], b[1]) + product(a[2], b[2])


def fast_triangles(lanes: SimpleNamespace, form: SimpleNamespace, kept: int) -> SimpleNamespace:
    """The test for these lanes and blocks, its ray kept from word `kept` of the stack."""
    length: int = lanes.triangles_length
    vector, products = lanes.triangles, lanes.products
    load, edge, edge_at, used = form.load, form.edge, form.edge_at, form.used
    stride_of, vertex_at = form.stride, form.vertex_at
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument

    @without_gradient
    @wp.func
    def prepare(ray: RayFrame, stack: stack_argument):
        """Keep what the test needs of a ray."""
        for axis in range(3):
            store_word(stack, kept + axis, wp.cast(ray.origin[axis], wp.uint32))
            store_word(stack, kept + 3 + axis, wp.cast(ray.direction[axis], wp.uint32))

    @without_gradient
    @wp.func
    def kept_vector(stack: stack_argument, first: int):
        """The three words from `first`: 0 for the origin, 3 for the direction."""
        return wp.vec3(
            wp.cast(load_word(stack, kept + first), wp.float32),
            wp.cast(load_word(stack, kept + first + 1), wp.float32),
            wp.cast(load_word(stack, kept + first + 2), wp.float32),
        )

    @without_gradient
    @wp.func
    def edge_vector(units: wp.uint64, at: int, stride: int, v0: wp.vec3):
        """From v0 to the vertex at this word."""
        return wp.vec3(
            edge_at(units, at, v0[0]),
            edge_at(units, at + stride, v0[1]),
            edge_at(units, at + 2 * stride, v0[2]),
        )

    @without_gradient
    @wp.func
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, negative: bool):
        """t, u and v of the block's triangle j, which the ray meets."""
        stride = stride_of(units, block)
        at = vertex_at(units, block, 0, j)
        v0 = wp.vec3(
            load_float(units, at), load_float(units, at + stride), load_float(units, at + 2 * stride)
        )
        e1 = edge_vector(units, vertex_at(units, block, 1, j), stride, v0)
        e2 = edge_vector(units, vertex_at(units, block, 2, j), stride, v0)
        d = kept_vector(stack, 3)
        p = _cross(d, e2)
        s = kept_vector(stack, 0) - v0
        q = _cross(s, e1)
        det = _dot(e1, p)
        size = wp.abs(det)
        t = flip_sign(_dot(e2, wp.vec3(q[0] / size, q[1] / size, q[2] / size)), det)
        return wp.vec3(t, flip_sign(_dot(s, p), det) / size, flip_sign(_dot(d, q), det) / size)

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line meets, one bit each; the second word is not used."""
        o = kept_vector(stack, 0)
        d = kept_vector(stack, 3)
        d0 = vector(d[0])
        d1 = vector(d[1])
        d2 = vector(d[2])
        sx = vector(o[0]) - load(units, block, lane, 0, 0)
        sy = vector(o[1]) - load(units, block, lane, 0, 1)
        sz = vector(o[2]) - load(units, block, lane, 0, 2)
        e1x = edge(units, block, lane, 1, 0)
        e1y = edge(units, block, lane, 1, 1)
        e1z = edge(units, block, lane, 1, 2)
        e2x = edge(units, block, lane, 2, 0)
        e2y = edge(units, block, lane, 2, 1)
        e2z = edge(units, block, lane, 2, 2)
        px = products(d1, e2z) - products(d2, e2y)
        py = products(d2, e2x) - products(d0, e2z)
        pz = products(d0, e2y) - products(d1, e2x)
        qx = products(sy, e1z) - products(sz, e1y)
        qy = products(sz, e1x) - products(sx, e1z)
        qz = products(sx, e1y) - products(sy, e1x)
        det = products(e1x, px) + products(e1y, py) + products(e1z, pz)
        us = products(sx, px) + products(sy, py) + products(sz, pz)
        vs = products(d0, qx) + products(d1, qy) + products(d2, qz)
        lanes = wp.uint32(0)
        for i in range(length):
            size = wp.abs(det[i])
            u = flip_sign(us[i], det[i])
            v = flip_sign(vs[i], det[i])
            # A determinant of zero (a ray in the triangle's plane) and NaN (an unused lane) must fail.
            if u >= 0.0 and v >= 0.0 and u + v <= size and size > 0.0:
                lanes = lanes | wp.uint32(1 << i)
        return wp.vec2ui(used(units, block, lane, lanes), wp.uint32(0))

    return SimpleNamespace(prepare=prepare, candidates=candidates, solve=solve)
