"""Woop, Benthin and Wald 2013 on a block's triangles, operation by operation as triangle_watertight.h."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.lanes.lanes import load_float, lowest_lane, product, product_double, without_gradient
from wive.warp_kernels.queries.frame import RayFrame, axes_of, component
from wive.warp_kernels.triangles.sheared import edges_in_lanes

# What the test keeps of a ray, in words: the axis behind each sheared axis, the origin, the direction (both
# sheared axis by axis) and the shear. It is needed in leaves only, so it waits in memory behind the stack's
# entries and holds no registers meanwhile.
KEPT_WORDS = 11


@wp.func
def flip(x: wp.float64, negative: bool):
    """x, negated where `negative`; never -0."""
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


def watertight_triangles(lanes: SimpleNamespace, form: SimpleNamespace, kept: int) -> SimpleNamespace:
    """The test for these lanes and blocks, its ray kept from word `kept` of the stack."""
    length: int = lanes.triangles_length
    used, stride_of, vertex_at = form.used, form.stride, form.vertex_at
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument

    @without_gradient
    @wp.func
    def axis_of(stack: stack_argument, axis: int):
        """The axis of the mesh that is this sheared axis."""
        return int(load_word(stack, kept + axis))

    @without_gradient
    @wp.func
    def kept_origin(stack: stack_argument, axis: int):
        """The ray's origin on a sheared axis."""
        return wp.cast(load_word(stack, kept + 3 + axis), wp.float32)

    @without_gradient
    @wp.func
    def kept_direction(stack: stack_argument, axis: int):
        """The ray's direction on a sheared axis, the longest last."""
        return wp.cast(load_word(stack, kept + 6 + axis), wp.float32)

    @without_gradient
    @wp.func
    def kept_shear(stack: stack_argument, axis: int):
        """The direction on a sheared axis over that on the longest."""
        return wp.cast(load_word(stack, kept + 9 + axis), wp.float32)

    @without_gradient
    @wp.func
    def prepare(ray: RayFrame, stack: stack_argument):
        """Keep what the test needs of a ray."""
        axes = axes_of(ray.longest_axis)
        forward = component(ray.direction, axes[2])
        for i in range(3):
            store_word(stack, kept + i, wp.uint32(axes[i]))
            store_word(stack, kept + 3 + i, wp.cast(component(ray.origin, axes[i]), wp.uint32))
            store_word(stack, kept + 6 + i, wp.cast(component(ray.direction, axes[i]), wp.uint32))
        for i in range(2):
            store_word(stack, kept + 9 + i, wp.cast(component(ray.direction, axes[i]) / forward, wp.uint32))

    @without_gradient
    @wp.func
    def rounded(units: wp.uint64, at: int, stride: int, stack: stack_argument):
        """A vertex in the sheared space, in float as the edge functions of all triangles round it."""
        z = load_float(units, at + stride * axis_of(stack, 2)) - kept_origin(stack, 2)
        x = (load_float(units, at + stride * axis_of(stack, 0)) - kept_origin(stack, 0)) - product(
            kept_shear(stack, 0), z
        )
        y = (load_float(units, at + stride * axis_of(stack, 1)) - kept_origin(stack, 1)) - product(
            kept_shear(stack, 1), z
        )
        return wp.vec3d(wp.float64(x), wp.float64(y), wp.float64(z))

    @without_gradient
    @wp.func
    def away(units: wp.uint64, at: int, stride: int, stack: stack_argument, axis: int):
        """From the ray's origin to a vertex on a sheared axis, exactly or rounded once in double."""
        return wp.float64(load_float(units, at + stride * axis_of(stack, axis))) - wp.float64(
            kept_origin(stack, axis)
        )

    @without_gradient
    @wp.func
    def across(units: wp.uint64, at: int, stride: int, stack: stack_argument, axis: int):
        """A vertex on the plane across the ray, scaled by the direction's longest component."""
        forward = wp.float64(kept_direction(stack, 2))
        slope = wp.float64(kept_direction(stack, axis))
        return product_double(away(units, at, stride, stack, axis), forward) - product_double(
            slope, away(units, at, stride, stack, 2)
        )

    @without_gradient
    @wp.func(inline=False)
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, negative: bool):
        """t, u and v in double, rounded once; of the rounded triangle where only rounding let the ray in."""
        stride = stride_of(units, block)
        at_a = vertex_at(units, block, 0, j)
        at_b = vertex_at(units, block, 1, j)
        at_c = vertex_at(units, block, 2, j)
        xa = across(units, at_a, stride, stack, 0)
        ya = across(units, at_a, stride, stack, 1)
        xb = across(units, at_b, stride, stack, 0)
        yb = across(units, at_b, stride, stack, 1)
        xc = across(units, at_c, stride, stack, 0)
        yc = across(units, at_c, stride, stack, 1)
        wa = flip(edge_of(xb, yb, xc, yc), negative)
        wb = flip(edge_of(xc, yc, xa, ya), negative)
        wc = flip(edge_of(xa, ya, xb, yb), negative)
        det = wa + wb + wc
        if wp.min(wp.min(wa, wb), wc) < wp.float64(0.0) or det <= wp.float64(0.0):
            return solve_rounded(units, block, j, stack)
        inverse = wp.float64(1.0) / det
        za = away(units, at_a, stride, stack, 2)
        zb = away(units, at_b, stride, stack, 2)
        zc = away(units, at_c, stride, stack, 2)
        height = product_double(wa, za) + product_double(wb, zb) + product_double(wc, zc)
        t = wp.float32(height / (det * wp.float64(kept_direction(stack, 2))))
        return wp.vec3(t, wp.float32(wb * inverse), wp.float32(wc * inverse))

    @without_gradient
    @wp.func(inline=False)
    def solve_rounded(units: wp.uint64, block: int, j: int, stack: stack_argument):
        """The same for the triangle with rounded corners."""
        stride = stride_of(units, block)
        at_a = vertex_at(units, block, 0, j)
        at_b = vertex_at(units, block, 1, j)
        at_c = vertex_at(units, block, 2, j)
        a = rounded(units, at_a, stride, stack)
        b = rounded(units, at_b, stride, stack)
        c = rounded(units, at_c, stride, stack)
        w = edges_of(a, b, c)
        det = w[0] + w[1] + w[2]
        height = product_double(w[0], a[2]) + product_double(w[1], b[2]) + product_double(w[2], c[2])
        t = wp.float32(height / (det * wp.float64(kept_direction(stack, 2))))
        return wp.vec3(t, wp.float32(w[1] / det), wp.float32(w[2] / det))

    @without_gradient
    @wp.func(inline=False)
    def side_of(units: wp.uint64, block: int, j: int, stack: stack_argument):
        """The side on which the ray passes the edges, 1 or -1, decided exactly; 0 where it misses."""
        stride = stride_of(units, block)
        at_a = vertex_at(units, block, 0, j)
        at_b = vertex_at(units, block, 1, j)
        at_c = vertex_at(units, block, 2, j)
        a = rounded(units, at_a, stride, stack)
        b = rounded(units, at_b, stride, stack)
        c = rounded(units, at_c, stride, stack)
        w = edges_of(a, b, c)
        zero = wp.float64(0.0)
        negative = wp.where(w[0] < zero or w[1] < zero or w[2] < zero, 1, 0)
        positive = wp.where(w[0] > zero or w[1] > zero or w[2] > zero, 1, 0)
        return positive - negative

    edges = edges_in_lanes(lanes, form, axis_of, kept_origin, kept_shear)

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line meets, one bit each, and those passed clockwise."""
        u, v, w = edges(units, block, lane, stack)
        low = wp.min(wp.min(u, v), w)
        high = wp.max(wp.max(u, v), w)
        lanes = wp.uint32(0)
        for i in range(length):
            if low[i] >= 0.0 or high[i] <= 0.0:
                lanes = lanes | wp.uint32(1 << i)
        lanes = used(units, block, lane, lanes)
        negative = wp.uint32(0)
        if lanes != wp.uint32(0):
            ties = wp.uint32(0)
            for i in range(length):
                if low[i] < 0.0:
                    negative = negative | wp.uint32(1 << i)
                if u[i] == 0.0 or v[i] == 0.0 or w[i] == 0.0:
                    ties = ties | wp.uint32(1 << i)
            # Where a product hid a sign, the products are taken again in double, where they are exact.
            ties = ties & lanes
            while ties != wp.uint32(0):
                i = lowest_lane(ties)
                bit = wp.uint32(1) << wp.uint32(i)
                ties = ties ^ bit
                side = side_of(units, block, wp.where(length == 1, lane & 3, i), stack)
                lanes = lanes & ~wp.where(side == 0, bit, wp.uint32(0))
                negative = (negative & ~bit) | wp.where(side < 0, bit, wp.uint32(0))
        return wp.vec2ui(lanes, negative)

    return SimpleNamespace(prepare=prepare, candidates=candidates, solve=solve)
