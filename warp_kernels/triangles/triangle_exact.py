"""The exact triangle test: a filter in double, then integers, as cpu/traverse/triangle_exact.h."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.exact_native import (
    compare_distances,
    may_hit,
    solve_exactly,
)
from wive.warp_kernels.lanes.lanes import product, without_gradient
from wive.warp_kernels.lanes.layout import NO_PRIM, NODE_WIDTH
from wive.warp_kernels.lanes.precision import stack_numbers
from wive.warp_kernels.queries.frame import MAX_FLOAT, SUBNORMAL_STEP, RayFrame, axes_of, by_sheared_axis
from wive.warp_kernels.queries.query import Query
from wive.warp_kernels.queries.query_exact import ExactBest

# What the test keeps of a ray, in words: the longest axis, then floats: origin, the caller's direction (three
# each) and limits, and t in the frame's units over the caller's t.
LONGEST_AXIS = 0
ORIGIN = 1
DIRECTION = 4
TMIN = 7
TMAX = 8
UNSCALE = 9
# Then doubles, of which these are the first: the direction on the other two axes over that on the longest,
# and one over that on the longest.
DOUBLE_WORDS = 10
SHEAR = 0
INVERSE = 2
RAY_WORDS = DOUBLE_WORDS + 2 * 3

SMALLEST_SHEAR = wp.constant(wp.float64(2.0**-100))
LOWEST = wp.constant(wp.float32(-MAX_FLOAT))


@wp.func
def shear_of(shear: wp.float64):
    """The shear, or zero if it moves nothing by as much as rounding does: so no product underflows."""
    return wp.where(wp.abs(shear) < SMALLEST_SHEAR, wp.float64(0.0), shear)


@wp.func
def block_of(place: int):
    """The block of a triangle's place."""
    return place & -8


def exact_triangles(
    lanes: SimpleNamespace, blocks: SimpleNamespace, ray_base: int, precision: str, crossings: bool
) -> SimpleNamespace:
    """The test for a lane form and block form; its ray is kept from stack word `ray_base` on.

    A triangle's place is one number: the word of its block, a multiple of eight, plus its lane.
    """
    length: int = lanes.triangles_length
    used, stride_of, vertex_at = blocks.used, blocks.stride, blocks.vertex_at
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument
    broadcast = lanes.broadcast
    numbers = stack_numbers(lanes, "float32", ray_base)
    doubles = stack_numbers(lanes, "float64", ray_base + DOUBLE_WORDS)
    store, load, load_vector = numbers.store, numbers.load, numbers.load_vector
    store_double, load_double = doubles.store, doubles.load

    @without_gradient
    @wp.func
    def prepare(ray: RayFrame, stack: stack_argument):
        """Keep what the test needs of a ray."""
        direction = by_sheared_axis(ray.given_direction, ray.longest_axis)
        store_word(stack, ray_base + LONGEST_AXIS, wp.uint32(ray.longest_axis))
        for i in range(3):
            store(stack, ORIGIN + i, ray.origin[i])
            store(stack, DIRECTION + i, ray.given_direction[i])
        store(stack, TMIN, ray.given_tmin)
        store(stack, TMAX, ray.given_tmax)
        store(stack, UNSCALE, ray.unscale)
        inverse = wp.float64(1.0) / wp.float64(direction[2])
        for i in range(2):
            shear = wp.float64(direction[i]) * inverse
            store_double(stack, SHEAR + i, shear_of(shear))
        store_double(stack, INVERSE, inverse)

    @without_gradient
    @wp.func
    def axes_kept(stack: stack_argument):
        """The mesh axes of the sheared axes."""
        return axes_of(int(load_word(stack, ray_base + LONGEST_AXIS)))

    @without_gradient
    @wp.func
    def vertices_of(units: wp.uint64, block: int, j: int):
        """The words at which the vertices of a block's triangle begin."""
        return wp.vec3i(
            vertex_at(units, block, 0, j), vertex_at(units, block, 1, j), vertex_at(units, block, 2, j)
        )

    @without_gradient
    @wp.func
    def candidates(units: wp.uint64, block: int, lane: int, stack: stack_argument):
        """The lanes whose triangle the ray's line may hit, one bit each; the second word is not used."""
        axes = axes_kept(stack)
        origin = load_vector(stack, ORIGIN)
        shear_x = load_double(stack, SHEAR)
        shear_y = load_double(stack, SHEAR + 1)
        stride = stride_of(units, block)
        hit_mask = wp.uint32(0)
        for i in range(length):
            at = vertices_of(units, block, wp.where(length == 1, lane & 3, i))
            if may_hit(units, at, stride, axes, origin, shear_x, shear_y):
                hit_mask = hit_mask | wp.uint32(1 << i)
        return wp.vec2ui(used(units, block, lane, hit_mask), wp.uint32(0))

    @without_gradient
    @wp.func(inline=False)
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, best_t: float):
        """t, u, v and 1; the last is 0 if the ray misses the triangle or hits it outside its limits.

        It is 0 also for a hit beyond best_t, which is in the caller's units.
        """
        return solve_exactly(
            units,
            vertices_of(units, block, j),
            stride_of(units, block),
            axes_kept(stack),
            load_vector(stack, ORIGIN),
            load_vector(stack, DIRECTION),
            load_double(stack, SHEAR),
            load_double(stack, SHEAR + 1),
            load_double(stack, INVERSE),
            load(stack, TMIN),
            wp.min(best_t, load(stack, TMAX)),
            crossings,
        )

    @without_gradient
    @wp.func(inline=False)
    def comes_before(
        units: wp.uint64, place: int, prim: int, other: int, other_prim: int, stack: stack_argument
    ):
        """Whether a hit is nearer than another of the same rounded t, or as near and of a lower prim."""
        block = block_of(place)
        other_block = block_of(other)
        order = compare_distances(
            units,
            vertices_of(units, block, place - block),
            stride_of(units, block),
            vertices_of(units, other_block, other - other_block),
            stride_of(units, other_block),
            load_vector(stack, ORIGIN),
            load_vector(stack, DIRECTION),
        )
        return order < 0 or (order == 0 and prim < other_prim)

    @without_gradient
    @wp.func
    def take_closest(
        best: ExactBest, units: wp.uint64, place: int, stack: stack_argument, hit: wp.vec4, prim: int
    ):
        """The nearest hit; of hits at the same t, the lowest prim."""
        nearer = best.prim == NO_PRIM or hit[0] < best.given_t
        if not nearer and hit[0] == best.given_t:
            nearer = comes_before(units, place, prim, best.place, best.prim, stack)
        if nearer:
            best.given_t = hit[0]
            best.u = hit[1]
            best.v = hit[2]
            best.prim = prim
            best.place = place
            # Boxes are lowered by more than t was rounded, unless t is a subnormal number or minus infinity.
            best.t = product(wp.max(hit[0], LOWEST) + SUBNORMAL_STEP, load(stack, UNSCALE))
        return best

    @without_gradient
    @wp.func
    def keep_nearest(units: wp.uint64, stack: stack_argument, lane: int, best: ExactBest):
        """Keep the nearest hit among a ray's eight threads; the other seven report a miss."""
        beaten = bool(False)
        i = int(0)
        while i < NODE_WIDTH:
            t = wp.cast(broadcast(wp.cast(best.given_t, wp.uint32), i), wp.float32)
            place = int(broadcast(wp.uint32(best.place), i))
            prim = int(broadcast(wp.uint32(best.prim), i))
            if lane != i and best.prim != NO_PRIM and prim != NO_PRIM:
                if t < best.given_t:
                    beaten = True
                if t == best.given_t and comes_before(units, place, prim, best.place, best.prim, stack):
                    beaten = True
            i += 1
        if beaten:
            best.prim = NO_PRIM
        return best

    return SimpleNamespace(
        prepare=prepare,
        candidates=candidates,
        solve=solve,
        take_closest=take_closest,
        keep_nearest=keep_nearest,
    )


def make_exact_offer(
    query: Query, lanes: SimpleNamespace, triangles: SimpleNamespace, real: type
) -> wp.Function:
    """The function that solves a triangle exactly and offers a hit within the limits to the query."""
    stack_argument, state_type = lanes.stack_argument, query.state
    solve, offer, take_closest = triangles.solve, query.offer, triangles.take_closest
    compares: bool = offer is None

    @without_gradient
    @wp.func
    def offer_triangle(
        found: state_type,
        units: wp.uint64,
        block: int,
        j: int,
        prim: int,
        negative: bool,
        tmin: real,
        stack: stack_argument,
    ):
        best_t = float(wp.inf)
        if wp.static(compares):
            best_t = found.given_t
        hit = solve(units, block, j, stack, best_t)
        if hit[3] != 0.0:
            if wp.static(compares):
                found = take_closest(found, units, block + j, stack, hit, prim)
            else:
                found = offer(found, hit, prim)
        return found

    return offer_triangle
