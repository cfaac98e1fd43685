"""Woop, Benthin and Wald 2013 in double on a block of a float64 tree, as cpu/triangle_watertight.h has it."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.frame import RayFrame64, axes_of, component
from wive.warp_kernels.lanes import load_double, lowest_lane, product_double, without_gradient
from wive.warp_kernels.native import LOW_PART
from wive.warp_kernels.precision import kept_numbers

# What the test keeps of a ray, in words: the axis behind each sheared axis, then doubles: the origin (sheared
# axis by axis), the shear, and the direction on the longest axis.
KEPT_WORDS = 3 + 2 * 6
SMALLEST_SHEAR = wp.constant(wp.float64(2.0**-100))


@wp.func_native(LOW_PART)
def low_part(a: wp.float64, b: wp.float64, rounded: wp.float64) -> wp.float64:
    """What rounding a b to `rounded` left out, exactly."""
    ...


@wp.func
def weight_of(a: wp.vec3d, b: wp.vec3d):
    """Of the edge from a to b, as all triangles round it."""
    return product_double(b[0], a[1]) - product_double(b[1], a[0])


@wp.func
def sign_of(a: wp.vec3d, b: wp.vec3d):
    """The exact sign of that weight, -1, 0 or 1."""
    one = product_double(b[0], a[1])
    other = product_double(b[1], a[0])
    difference = one - other
    if difference == wp.float64(0.0):
        difference = low_part(b[0], a[1], one) - low_part(b[1], a[0], other)
    zero = wp.float64(0.0)
    return wp.where(difference > zero, 1, 0) - wp.where(difference < zero, 1, 0)


def watertight_doubles(lanes: SimpleNamespace, form: SimpleNamespace, kept: int) -> SimpleNamespace:
    """The test for these lanes and blocks, its ray kept from word `kept` of the stack."""
    length: int = lanes.triangles_length
    vector, products = lanes.triangles, lanes.products
    load, used, stride_of, vertex_at = form.load, form.used, form.stride, form.vertex_at
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
    @wp.func(inline=False)
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, negative: bool):
        """t, u and v of the rounded triangle, from the weights that the ray passed."""
        a = sheared(units, block, j, 0, stack)
        b = sheared(units, block, j, 1, stack)
        c = sheared(units, block, j, 2, stack)
        wa = weight_of(b, c)
        wb = weight_of(c, a)
        wc = weight_of(a, b)
        det = wa + wb + wc
        height = product_double(wa, a[2]) + product_double(wb, b[2]) + product_double(wc, c[2])
        return wp.vec3d(height / product_double(det, load_kept(stack, 5)), wb / det, wc / det)

    @without_gradient
    @wp.func(inline=False)
    def side_of(units: wp.uint64, block: int, j: int, stack: stack_argument):
        """The side on which the ray passes the edges, 1 or -1, decided exactly; 0 where it misses."""
        a = sheared(units, block, j, 0, stack)
        b = sheared(units, block, j, 1, stack)
        c = sheared(units, block, j, 2, stack)
        u = sign_of(b, c)
        v = sign_of(c, a)
        w = sign_of(a, b)
        negative = wp.where(u < 0 or v < 0 or w < 0, 1, 0)
        positive = wp.where(u > 0 or v > 0 or w > 0, 1, 0)
        return positive - negative

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line meets, one bit each; the second word is not used."""
        x = axis_of(stack, 0)
        y = axis_of(stack, 1)
        z = axis_of(stack, 2)
        ox = vector(load_kept(stack, 0))
        oy = vector(load_kept(stack, 1))
        oz = vector(load_kept(stack, 2))
        sx = vector(load_kept(stack, 3))
        sy = vector(load_kept(stack, 4))
        za = load(units, block, lane, 0, z) - oz
        zb = load(units, block, lane, 1, z) - oz
        zc = load(units, block, lane, 2, z) - oz
        xa = (load(units, block, lane, 0, x) - ox) - products(sx, za)
        xb = (load(units, block, lane, 1, x) - ox) - products(sx, zb)
        xc = (load(units, block, lane, 2, x) - ox) - products(sx, zc)
        ya = (load(units, block, lane, 0, y) - oy) - products(sy, za)
        yb = (load(units, block, lane, 1, y) - oy) - products(sy, zb)
        yc = (load(units, block, lane, 2, y) - oy) - products(sy, zc)
        u = products(xc, yb) - products(yc, xb)
        v = products(xa, yc) - products(ya, xc)
        w = products(xb, ya) - products(yb, xa)
        low = wp.min(wp.min(u, v), w)
        high = wp.max(wp.max(u, v), w)
        zero = wp.float64(0.0)
        lanes = wp.uint32(0)
        for i in range(length):
            if low[i] >= zero or high[i] <= zero:
                lanes = lanes | wp.uint32(1 << i)
        lanes = used(units, block, lane, lanes)
        if lanes != wp.uint32(0):
            ties = wp.uint32(0)
            for i in range(length):
                if u[i] == zero or v[i] == zero or w[i] == zero:
                    ties = ties | wp.uint32(1 << i)
            # Where two products are equal, what rounding left out of them decides.
            ties = ties & lanes
            while ties != wp.uint32(0):
                i = lowest_lane(ties)
                bit = wp.uint32(1) << wp.uint32(i)
                ties = ties ^ bit
                side = side_of(units, block, wp.where(length == 1, lane & 3, i), stack)
                lanes = lanes & ~wp.where(side == 0, bit, wp.uint32(0))
        return wp.vec2ui(lanes, wp.uint32(0))

    return SimpleNamespace(prepare=prepare, candidates=candidates, solve=solve)
