"""Edge functions of the watertight test, in either precision, and the side on which a ray passes them."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient


@wp.func
def beside(side: wp.float64, p: wp.vec3d, q: wp.vec3d):
    """An edge function's sign for crossings: if it is zero, that of the ray moved by (h, h^2), h -> 0."""
    return wp.where(side != wp.float64(0.0), side, wp.where(p[1] != q[1], p[1] - q[1], q[0] - p[0]))


@wp.func
def sides_beside(sides: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """The edge functions opposite to the corners a, b and c as the moved ray has them.

    None is zero unless two corners are one. As cpu/traverse/crossings.h, which says why.
    """
    return wp.vec3d(beside(sides[0], c, b), beside(sides[1], a, c), beside(sides[2], b, a))


@wp.func
def side_passed(sides: wp.vec3d):
    """1 or -1, the sign of the edge functions; 0 if they differ in sign or are all zero."""
    zero = wp.float64(0.0)
    negative = wp.where(sides[0] < zero or sides[1] < zero or sides[2] < zero, 1, 0)
    positive = wp.where(sides[0] > zero or sides[1] > zero or sides[2] > zero, 1, 0)
    return positive - negative


def edges_in_lanes(
    lanes: SimpleNamespace,
    blocks: SimpleNamespace,
    axis_of: wp.Function,
    origin_of: wp.Function,
    shear_of: wp.Function,
) -> wp.Function:
    """The edge functions opposite to each corner of a block's triangles.

    The three functions read what the stack keeps of the ray: the mesh axis of a sheared axis, and the origin
    and the shear on a sheared axis.
    """
    vector, products, corners = lanes.triangles, lanes.products, blocks.corners
    stack_argument = lanes.stack_argument

    @without_gradient
    @wp.func
    def edges(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        axes = wp.vec3i(axis_of(stack, 0), axis_of(stack, 1), axis_of(stack, 2))
        ox = vector(origin_of(stack, 0))
        oy = vector(origin_of(stack, 1))
        oz = vector(origin_of(stack, 2))
        sx = vector(shear_of(stack, 0))
        sy = vector(shear_of(stack, 1))
        xa, ya, za = corners(units, block, lane, 0, axes)
        xb, yb, zb = corners(units, block, lane, 1, axes)
        xc, yc, zc = corners(units, block, lane, 2, axes)
        za = za - oz
        zb = zb - oz
        zc = zc - oz
        xa = (xa - ox) - products(sx, za)
        xb = (xb - ox) - products(sx, zb)
        xc = (xc - ox) - products(sx, zc)
        ya = (ya - oy) - products(sy, za)
        yb = (yb - oy) - products(sy, zb)
        yc = (yc - oy) - products(sy, zc)
        u = products(xc, yb) - products(yc, xb)
        v = products(xa, yc) - products(ya, xc)
        w = products(xb, ya) - products(yb, xa)
        return u, v, w

    return edges
