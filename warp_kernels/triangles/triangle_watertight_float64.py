"""The watertight test in float64 trees: Woop, Benthin and Wald 2013 on blocks of doubles.

The operations are those of cpu/traverse/triangle_watertight.h and triangle_watertight_float64.h, in the same
order.
"""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import product_double, without_gradient
from wive.warp_kernels.lanes.native import EXACT_WEIGHT
from wive.warp_kernels.lanes.precision import stack_numbers
from wive.warp_kernels.lanes.vectors import make_larger, make_smaller
from wive.warp_kernels.queries.frame import RayFrame64, axes_of, by_sheared_axis
from wive.warp_kernels.triangles.sheared import edges_in_lanes, side_passed, sides_beside

# What the test keeps of a ray: the mesh axis of each sheared axis, three words, then doubles, of which these
# are the first: origin (three), shear (two), direction on the longest axis.
AXIS_WORDS = 3
ORIGIN = 0
SHEAR = 3
FORWARD = 5
RAY_WORDS = AXIS_WORDS + 2 * 6
LEAST_SUM = wp.constant(wp.float64(2.0**-26))
SMALLEST_SUM = wp.constant(wp.float64(2.0**-400))  # above it no product that matters underflows
SMALL_SIZE = wp.constant(wp.float64(2.0**-300))
SCALE_UP = wp.constant(wp.float64(2.0**300))
SMALLEST_SHEAR = wp.constant(wp.float64(2.0**-100))


@wp.func_native(EXACT_WEIGHT)
def exact_weight(x1: wp.float64, y1: wp.float64, x2: wp.float64, y2: wp.float64) -> wp.float64:
    """x1 y2 - y1 x2 with the exact sign, and zero only if it is exactly zero."""
    ...


@wp.func
def weight_of(a: wp.vec3d, b: wp.vec3d):
    """The edge function of the edge from a to b, as all triangles round it."""
    return product_double(b[0], a[1]) - product_double(b[1], a[0])


@wp.func
def exact_weight_of(a: wp.vec3d, b: wp.vec3d):
    """The edge function with its exact sign."""
    return exact_weight(b[0], b[1], a[0], a[1])


@wp.func
def largest(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, axis: int):
    """The largest by_sheared_axis of a triangle's corners on an axis."""
    return wp.max(wp.max(wp.abs(a[axis]), wp.abs(b[axis])), wp.abs(c[axis]))


def watertight_doubles(
    lanes: SimpleNamespace, blocks: SimpleNamespace, ray_base: int, precision: str, crossings: bool
) -> SimpleNamespace:
    """The test for a lane form and block form; its ray is kept from stack word `ray_base` on."""
    length: int = lanes.triangles_length
    larger, smaller = make_larger(lanes.triangles), make_smaller(lanes.triangles)
    used, corner = blocks.used, blocks.corner
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument
    numbers = stack_numbers(lanes, precision, ray_base + AXIS_WORDS)
    store, load = numbers.store, numbers.load

    @without_gradient
    @wp.func
    def axis_of(stack: stack_argument, axis: int):
        """The mesh axis of a sheared axis."""
        return int(load_word(stack, ray_base + axis))

    @without_gradient
    @wp.func
    def origin_of(stack: stack_argument, axis: int):
        return load(stack, ORIGIN + axis)

    @without_gradient
    @wp.func
    def shear_of(stack: stack_argument, axis: int):
        """The direction on a sheared axis over that on the longest."""
        return load(stack, SHEAR + axis)

    @without_gradient
    @wp.func
    def prepare(ray: RayFrame64, stack: stack_argument):
        """Keep what the test needs of a ray."""
        axes = axes_of(ray.longest_axis)
        origin = by_sheared_axis(ray.origin, ray.longest_axis)
        direction = by_sheared_axis(ray.direction, ray.longest_axis)
        for i in range(3):
            store_word(stack, ray_base + i, wp.uint32(axes[i]))
            store(stack, ORIGIN + i, origin[i])
        for i in range(2):
            shear = direction[i] / direction[2]
            store(stack, SHEAR + i, wp.where(wp.abs(shear) < SMALLEST_SHEAR, wp.float64(0.0), shear))
        store(stack, FORWARD, direction[2])

    @without_gradient
    @wp.func
    def sheared(units: wp.uint64, block: int, j: int, k: int, stack: stack_argument):
        """A vertex in the sheared space, rounded alike for every triangle that has it."""
        axes = wp.vec3i(axis_of(stack, 0), axis_of(stack, 1), axis_of(stack, 2))
        v = corner(units, block, k, j, axes)
        z = v[2] - origin_of(stack, 2)
        x = v[0] - origin_of(stack, 0)
        y = v[1] - origin_of(stack, 1)
        return wp.vec3d(
            x - product_double(shear_of(stack, 0), z), y - product_double(shear_of(stack, 1), z), z
        )

    @without_gradient
    @wp.func
    def hit_of(wa: wp.float64, wb: wp.float64, wc: wp.float64, z: wp.vec3d, stack: stack_argument):
        """t, u and v from the weights and depths of the corners."""
        det = wa + wb + wc
        height = product_double(wa, z[0]) + product_double(wb, z[1]) + product_double(wc, z[2])
        return wp.vec3d(height / product_double(det, load(stack, FORWARD)), wb / det, wc / det)

    @without_gradient
    @wp.func(inline=False)
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, negative: bool):
        """t, u and v of the rounded triangle; t is NaN, which no query takes, if exact weights say miss."""
        a = sheared(units, block, j, 0, stack)
        b = sheared(units, block, j, 1, stack)
        c = sheared(units, block, j, 2, stack)
        wa = weight_of(b, c)
        wb = weight_of(c, a)
        wc = weight_of(a, b)
        zero = wp.float64(0.0)
        product_bound = product_double(largest(a, b, c, 0), largest(a, b, c, 1))
        least = wp.max(product_double(product_bound, LEAST_SUM), SMALLEST_SUM)
        if wp.abs(wa + wb + wc) <= least or wa == zero or wb == zero or wc == zero:
            return solve_exactly(units, block, j, stack)
        return hit_of(wa, wb, wc, wp.vec3d(a[2], b[2], c[2]), stack)

    @without_gradient
    @wp.func(inline=False)
    def solve_exactly(units: wp.uint64, block: int, j: int, stack: stack_argument):
        """t, u and v with exact weights; a triangle on both sides of the ray, or edge-on, is missed."""
        a = sheared(units, block, j, 0, stack)
        b = sheared(units, block, j, 1, stack)
        c = sheared(units, block, j, 2, stack)
        # Scaled up until products don't underflow; the signs and ratios of weights stay.
        scale = wp.float64(1.0)
        size = wp.max(largest(a, b, c, 0), largest(a, b, c, 1))
        zero = wp.float64(0.0)
        while size > zero and size < SMALL_SIZE:
            scale = scale * SCALE_UP
            size = size * SCALE_UP
        z = wp.vec3d(a[2], b[2], c[2])
        a = a * scale
        b = b * scale
        c = c * scale
        wa = exact_weight_of(b, c)
        wb = exact_weight_of(c, a)
        wc = exact_weight_of(a, b)
        det = wa + wb + wc
        # Shares before products, which could underflow otherwise.
        shares = wp.vec3d(wa / det, wb / det, wc / det)
        depth = (
            product_double(shares[0], z[0])
            + product_double(shares[1], z[1])
            + product_double(shares[2], z[2])
        )
        hit = wp.vec3d(depth / load(stack, FORWARD), shares[1], shares[2])
        sides = wp.vec3d(wa, wb, wc)
        if wp.static(crossings):
            sides = sides_beside(sides, a, b, c)
        if side_passed(sides) == 0:
            hit[0] = wp.float64(wp.nan)
        return wp.vec3d(hit[0], hit[1] + zero, hit[2] + zero)  # no -0

    edges = edges_in_lanes(lanes, blocks, axis_of, origin_of, shear_of)

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line may hit, one bit each; the second word is not used."""
        u, v, w = edges(units, block, lane, stack)
        low = smaller(smaller(u, v), w)
        high = larger(larger(u, v), w)
        zero = wp.float64(0.0)
        hit_mask = wp.uint32(0)
        for i in range(length):
            if low[i] >= zero or high[i] <= zero:
                hit_mask = hit_mask | wp.uint32(1 << i)
        return wp.vec2ui(used(units, block, lane, hit_mask), wp.uint32(0))

    return SimpleNamespace(prepare=prepare, candidates=candidates, solve=solve)
