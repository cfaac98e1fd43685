"""The watertight test: Woop, Benthin and Wald 2013.

The operations are those of cpu/traverse/triangle_watertight.h, in the same order.
"""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import lowest_lane, product, product_double, without_gradient
from wive.warp_kernels.lanes.precision import stack_numbers
from wive.warp_kernels.lanes.vectors import make_bits, make_larger, make_smaller
from wive.warp_kernels.queries.frame import RayFrame, axes_of, by_sheared_axis
from wive.warp_kernels.triangles.sheared import edges_in_lanes, side_passed, sides_beside

# What the test keeps of a ray, in words: the mesh axis of each sheared axis, then floats by sheared axis:
# origin, direction (three each) and shear (two). Only leaves need it, so it is kept in the stack's memory
# rather than in registers.
AXES = 0
ORIGIN = 3
DIRECTION = 6
SHEAR = 9
RAY_WORDS = 11
# Of the least and the largest edge function of a triangle: they do not differ in sign, one is zero, or the
# least is negative.
SAME_SIGN = (("low", ">=", "0"), ("high", "<=", "0"))
TIED = (("low", "==", "0"), ("high", "==", "0"))
NEGATIVE = (("low", "<", "0"),)
# The least sum of the weights that is trusted, relative to the largest of their products.
LEAST_WEIGHT = wp.constant(wp.float64(2.0**-28))


@wp.func
def flip(x: wp.float64, negative: bool):
    """x, negated if `negative`; never -0."""
    return wp.where(negative, -x, x) + wp.float64(0.0)


@wp.func
def edge_of(ax: wp.float64, ay: wp.float64, bx: wp.float64, by: wp.float64):
    """The edge function of the edge from a to b."""
    return product_double(bx, ay) - product_double(by, ax)


@wp.func
def edges_of(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """The edge functions opposite to each corner of a triangle in the sheared space."""
    return wp.vec3d(
        edge_of(b[0], b[1], c[0], c[1]), edge_of(c[0], c[1], a[0], a[1]), edge_of(a[0], a[1], b[0], b[1])
    )


def watertight_triangles(
    lanes: SimpleNamespace, blocks: SimpleNamespace, ray_base: int, precision: str, crossings: bool
) -> SimpleNamespace:
    """The test for a lane form and block form; its ray is kept from stack word `ray_base` on."""
    length: int = lanes.triangles_length
    larger, smaller = make_larger(lanes.triangles), make_smaller(lanes.triangles)
    same_sign, tied, negative_in = (
        make_bits(lanes.triangles, *signs) for signs in (SAME_SIGN, TIED, NEGATIVE)
    )
    used, corner = blocks.used, blocks.corner
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument
    numbers = stack_numbers(lanes, precision, ray_base)
    store, load = numbers.store, numbers.load

    @without_gradient
    @wp.func
    def axis_of(stack: stack_argument, axis: int):
        """The mesh axis of a sheared axis."""
        return int(load_word(stack, ray_base + AXES + axis))

    @without_gradient
    @wp.func
    def origin_of(stack: stack_argument, axis: int):
        """The ray's origin on a sheared axis."""
        return load(stack, ORIGIN + axis)

    @without_gradient
    @wp.func
    def direction_of(stack: stack_argument, axis: int):
        """The ray's direction on a sheared axis, the longest last."""
        return load(stack, DIRECTION + axis)

    @without_gradient
    @wp.func
    def shear_of(stack: stack_argument, axis: int):
        """The direction on a sheared axis over that on the longest."""
        return load(stack, SHEAR + axis)

    @without_gradient
    @wp.func
    def prepare(ray: RayFrame, stack: stack_argument):
        """Keep what the test needs of a ray."""
        axes = axes_of(ray.longest_axis)
        origin = by_sheared_axis(ray.origin, ray.longest_axis)
        direction = by_sheared_axis(ray.direction, ray.longest_axis)
        for i in range(3):
            store_word(stack, ray_base + AXES + i, wp.uint32(axes[i]))
            store(stack, ORIGIN + i, origin[i])
            store(stack, DIRECTION + i, direction[i])
        for i in range(2):
            store(stack, SHEAR + i, direction[i] / direction[2])

    @without_gradient
    @wp.func
    def corner_of(units: wp.uint64, block: int, k: int, j: int, stack: stack_argument):
        """A corner of the block's triangle j by sheared axis."""
        axes = wp.vec3i(axis_of(stack, 0), axis_of(stack, 1), axis_of(stack, 2))
        return corner(units, block, k, j, axes)

    @without_gradient
    @wp.func
    def rounded(units: wp.uint64, block: int, k: int, j: int, stack: stack_argument):
        """A corner in the sheared space, rounded to float alike for every triangle that has it."""
        v = corner_of(units, block, k, j, stack)
        z = v[2] - origin_of(stack, 2)
        x = (v[0] - origin_of(stack, 0)) - product(shear_of(stack, 0), z)
        y = (v[1] - origin_of(stack, 1)) - product(shear_of(stack, 1), z)
        return wp.vec3d(wp.float64(x), wp.float64(y), wp.float64(z))

    @without_gradient
    @wp.func
    def away(v: wp.vec3, stack: stack_argument, axis: int):
        """The way from the ray's origin to a corner on a sheared axis, exact or rounded once in double."""
        return wp.float64(v[axis]) - wp.float64(origin_of(stack, axis))

    @without_gradient
    @wp.func
    def across(v: wp.vec3, stack: stack_argument, axis: int):
        """A corner in the plane across the ray, scaled by the direction's longest by_sheared_axis."""
        forward = wp.float64(direction_of(stack, 2))
        slope = wp.float64(direction_of(stack, axis))
        return product_double(away(v, stack, axis), forward) - product_double(slope, away(v, stack, 2))

    @without_gradient
    @wp.func(inline=False)
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, negative: bool):
        """t, u and v in double, rounded once; those of the rounded triangle if only it is hit."""
        a = corner_of(units, block, 0, j, stack)
        b = corner_of(units, block, 1, j, stack)
        c = corner_of(units, block, 2, j, stack)
        xa = across(a, stack, 0)
        ya = across(a, stack, 1)
        xb = across(b, stack, 0)
        yb = across(b, stack, 1)
        xc = across(c, stack, 0)
        yc = across(c, stack, 1)
        wa = flip(edge_of(xb, yb, xc, yc), negative)
        wb = flip(edge_of(xc, yc, xa, ya), negative)
        wc = flip(edge_of(xa, ya, xb, yb), negative)
        det = wa + wb + wc
        least = wp.abs(product_double(xc, yb))
        least = wp.max(least, wp.abs(product_double(xa, yc)))
        least = wp.max(least, wp.abs(product_double(xb, ya))) * LEAST_WEIGHT
        if wp.min(wp.min(wa, wb), wc) < wp.float64(0.0) or det <= least:
            return solve_rounded(units, block, j, stack)
        inverse = wp.float64(1.0) / det
        height = product_double(wa, away(a, stack, 2)) + product_double(wb, away(b, stack, 2))
        height = height + product_double(wc, away(c, stack, 2))
        t = wp.float32(height / (det * wp.float64(direction_of(stack, 2))))
        return wp.vec3(t, wp.float32(wb * inverse), wp.float32(wc * inverse))

    @without_gradient
    @wp.func(inline=False)
    def solve_rounded(units: wp.uint64, block: int, j: int, stack: stack_argument):
        """t, u and v of the triangle with rounded corners."""
        a = rounded(units, block, 0, j, stack)
        b = rounded(units, block, 1, j, stack)
        c = rounded(units, block, 2, j, stack)
        w = edges_of(a, b, c)
        det = w[0] + w[1] + w[2]
        height = product_double(w[0], a[2]) + product_double(w[1], b[2]) + product_double(w[2], c[2])
        t = wp.float32(height / (det * wp.float64(direction_of(stack, 2))))
        return wp.vec3(t, wp.float32(w[1] / det), wp.float32(w[2] / det))

    @without_gradient
    @wp.func(inline=False)
    def side_of(units: wp.uint64, block: int, j: int, stack: stack_argument):
        """The side on which the ray passes the edges, 1 or -1, decided exactly; 0 if it misses."""
        a = rounded(units, block, 0, j, stack)
        b = rounded(units, block, 1, j, stack)
        c = rounded(units, block, 2, j, stack)
        sides = edges_of(a, b, c)
        if wp.static(crossings):
            sides = sides_beside(sides, a, b, c)
        return side_passed(sides)

    edges = edges_in_lanes(lanes, blocks, axis_of, origin_of, shear_of)

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line hits, one bit each, and those that it passes clockwise."""
        u, v, w = edges(units, block, lane, stack)
        low = smaller(smaller(u, v), w)
        high = larger(larger(u, v), w)
        hit_mask = used(units, block, lane, same_sign(low, high, 0))
        negative = wp.uint32(0)
        if hit_mask != wp.uint32(0):
            negative = negative_in(low, high, 0)
            # An edge function of zero may hide a sign; it is computed again in double, which holds products.
            ties = tied(low, high, 0) & hit_mask
            while ties != wp.uint32(0):
                i = lowest_lane(ties)
                bit = wp.uint32(1) << wp.uint32(i)
                ties = ties ^ bit
                side = side_of(units, block, wp.where(length == 1, lane & 3, i), stack)
                hit_mask = hit_mask & ~wp.where(side == 0, bit, wp.uint32(0))
                negative = (negative & ~bit) | wp.where(side < 0, bit, wp.uint32(0))
        return wp.vec2ui(hit_mask, negative)

    return SimpleNamespace(prepare=prepare, candidates=candidates, solve=solve)
