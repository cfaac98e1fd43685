"""Woop, Benthin and Wald 2013 on a block of doubles, as triangle_watertight.h and _float64.h have it."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.lanes.lanes import load_double, product_double, without_gradient
from wive.warp_kernels.lanes.native import EXACT_WEIGHT
from wive.warp_kernels.lanes.precision import kept_numbers
from wive.warp_kernels.queries.frame import RayFrame64, axes_of, component
from wive.warp_kernels.triangles.sheared import edges_in_lanes

# What the test keeps of a ray, in words: the axis behind each sheared axis, then doubles: the origin (sheared
# axis by axis), the shear, and the direction on the longest axis.
KEPT_WORDS = 3 + 2 * 6
LEAST_SUM = wp.constant(wp.float64(2.0**-26))
SMALLEST_SHEAR = wp.constant(wp.float64(2.0**-100))


@wp.func_native(EXACT_WEIGHT)
def exact_weight(x1: wp.float64, y1: wp.float64, x2: wp.float64, y2: wp.float64) -> wp.float64:
    """x1 y2 - y1 x2 with the exact sign, and zero only where it is zero."""
    ...


@wp.func
def weight_of(a: wp.vec3d, b: wp.vec3d):
    """The edge function of the edge from a to b, as all triangles round it."""
    return product_double(b[0], a[1]) - product_double(b[1], a[0])


@wp.func
def exact_weight_of(a: wp.vec3d, b: wp.vec3d):
    """The same with the exact sign."""
    return exact_weight(b[0], b[1], a[0], a[1])


@wp.func
def largest(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, axis: int):
    """The largest component of a triangle's corners on an axis."""
    return wp.max(wp.max(wp.abs(a[axis]), wp.abs(b[axis])), wp.abs(c[axis]))


def watertight_doubles(lanes: SimpleNamespace, form: SimpleNamespace, kept: int) -> SimpleNamespace:
    """The test for these lanes and blocks, its ray kept from word `kept` of the stack."""
    length: int = lanes.triangles_length
    used, stride_of, vertex_at = form.used, form.stride, form.vertex_at
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument
    numbers = kept_numbers(lanes, "float64", kept + 3)
    store, load_kept = numbers.store, numbers.load

    @without_gradient
    @wp.func
    def axis_of(stack: stack_argument, axis: int):
        """The axis of the mesh that is this sheared axis."""
        return int(load_word(stack, kept + axis))

    @without_gradient
    @wp.func
    def prepare(ray: RayFrame64, stack: stack_argument):
        """Keep what the test needs of a ray."""
        axes = axes_of(ray.longest_axis)
        forward = component(ray.direction, axes[2])
        for i in range(3):
            store_word(stack, kept + i, wp.uint32(axes[i]))
            store(stack, i, component(ray.origin, axes[i]))
        for i in range(2):
            shear = component(ray.direction, axes[i]) / forward
            store(stack, 3 + i, wp.where(wp.abs(shear) < SMALLEST_SHEAR, wp.float64(0.0), shear))
        store(stack, 5, forward)

    @without_gradient
    @wp.func
    def sheared(units: wp.uint64, block: int, j: int, k: int, stack: stack_argument):
        """A vertex in the sheared space, rounded as for every triangle that has it."""
        at = vertex_at(units, block, k, j)
        stride = stride_of(units, block)
        z = load_double(units, at + stride * axis_of(stack, 2)) - load_kept(stack, 2)
        x = load_double(units, at + stride * axis_of(stack, 0)) - load_kept(stack, 0)
        y = load_double(units, at + stride * axis_of(stack, 1)) - load_kept(stack, 1)
        return wp.vec3d(
            x - product_double(load_kept(stack, 3), z), y - product_double(load_kept(stack, 4), z), z
        )

    @without_gradient
    @wp.func
    def meeting(wa: wp.float64, wb: wp.float64, wc: wp.float64, z: wp.vec3d, stack: stack_argument):
        """t, u and v from the weights and depths of the corners."""
        det = wa + wb + wc
        height = product_double(wa, z[0]) + product_double(wb, z[1]) + product_double(wc, z[2])
        return wp.vec3d(height / product_double(det, load_kept(stack, 5)), wb / det, wc / det)

    @without_gradient
    @wp.func(inline=False)
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, negative: bool):
        """t, u and v of the rounded triangle; NaN, which no query takes, where its exact weights say miss."""
        a = sheared(units, block, j, 0, stack)
        b = sheared(units, block, j, 1, stack)
        c = sheared(units, block, j, 2, stack)
        wa = weight_of(b, c)
        wb = weight_of(c, a)
        wc = weight_of(a, b)
        zero = wp.float64(0.0)
        reach = product_double(largest(a, b, c, 0), largest(a, b, c, 1))
        least = product_double(reach, LEAST_SUM)
        if wp.abs(wa + wb + wc) <= least or wa == zero or wb == zero or wc == zero:
            return solve_exactly(units, block, j, stack)
        return meeting(wa, wb, wc, wp.vec3d(a[2], b[2], c[2]), stack)

    @without_gradient
    @wp.func(inline=False)
    def solve_exactly(units: wp.uint64, block: int, j: int, stack: stack_argument):
        """The same with the exact signs of weights: on both sides of the ray, or edge-on, is a miss."""
        a = sheared(units, block, j, 0, stack)
        b = sheared(units, block, j, 1, stack)
        c = sheared(units, block, j, 2, stack)
        wa = exact_weight_of(b, c)
        wb = exact_weight_of(c, a)
        wc = exact_weight_of(a, b)
        zero = wp.float64(0.0)
        hit = meeting(wa, wb, wc, wp.vec3d(a[2], b[2], c[2]), stack)
        negative = wa < zero or wb < zero or wc < zero
        positive = wa > zero or wb > zero or wc > zero
        if negative == positive:
            hit[0] = wp.float64(wp.nan)
        return wp.vec3d(hit[0], hit[1] + zero, hit[2] + zero)  # no -0

    @without_gradient
    @wp.func
    def kept_shear(stack: stack_argument, axis: int):
        """The direction on a sheared axis over that on the longest."""
        return load_kept(stack, 3 + axis)

    edges = edges_in_lanes(lanes, form, axis_of, load_kept, kept_shear)

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line may meet, one bit each; the second word is not used."""
        u, v, w = edges(units, block, lane, stack)
        low = wp.min(wp.min(u, v), w)
        high = wp.max(wp.max(u, v), w)
        zero = wp.float64(0.0)
        lanes = wp.uint32(0)
        for i in range(length):
            if low[i] >= zero or high[i] <= zero:
                lanes = lanes | wp.uint32(1 << i)
        return wp.vec2ui(used(units, block, lane, lanes), wp.uint32(0))

    return SimpleNamespace(prepare=prepare, candidates=candidates, solve=solve)
