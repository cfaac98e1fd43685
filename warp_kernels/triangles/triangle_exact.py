"""Exact hits on a block's triangles, as cpu/traverse/triangle_exact.h: a filter in double, then integers."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.lanes.exact_native import (
    compare_distances,
    lies_within,
    may_meet,
    solve_exactly,
)
from wive.warp_kernels.lanes.lanes import load_float, lowest_lane, product, without_gradient
from wive.warp_kernels.queries.frame import RayFrame, axes_of, component
from wive.warp_kernels.queries.query_exact import ExactBest
from wive.warp_kernels.tree.handle import BLOCK_WIDTH, NO_PRIM

# What the test keeps of a ray: the longest axis, the origin, the caller's direction and limits, the scale of
# its t, and three doubles of two words each: the direction on the other two axes over that on the longest,
# and 1 over that.
KEPT_WORDS = 16
SMALLEST_SLOPE = wp.constant(wp.float64(2.0**-100))
SUBNORMAL_STEP = wp.constant(wp.float32(2.0**-148))


@wp.func
def slope_of(slope: wp.float64):
    """Smaller slopes move nothing by as much as rounding does; without them no product underflows."""
    return wp.where(wp.abs(slope) < SMALLEST_SLOPE, wp.float64(0.0), slope)


@wp.func
def block_of(place: int):
    """The block of a triangle's place."""
    return place & -8


def exact_triangles(lanes: SimpleNamespace, form: SimpleNamespace, kept: int) -> SimpleNamespace:
    """The test for these lanes and blocks, its ray kept from word `kept` of the stack.

    A triangle's place is one number: the word of its block, a multiple of eight, plus its lane.
    """
    length: int = lanes.triangles_length
    used, stride_of, vertex_at = form.used, form.stride, form.vertex_at
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument
    or_reduce = lanes.or_reduce

    @without_gradient
    @wp.func
    def store_double(stack: stack_argument, at: int, x: wp.float64):
        bits = wp.cast(x, wp.uint64)
        store_word(stack, at, wp.uint32(bits & wp.uint64(0xFFFFFFFF)))
        store_word(stack, at + 1, wp.uint32(bits >> wp.uint64(32)))

    @without_gradient
    @wp.func
    def load_double(stack: stack_argument, at: int):
        high = wp.uint64(load_word(stack, at + 1))
        return wp.cast(wp.uint64(load_word(stack, at)) | (high << wp.uint64(32)), wp.float64)

    @without_gradient
    @wp.func
    def kept_number(stack: stack_argument, at: int):
        return wp.cast(load_word(stack, kept + at), wp.float32)

    @without_gradient
    @wp.func
    def kept_vector(stack: stack_argument, at: int):
        """The three numbers from `at`: 1 for the origin, 4 for the direction."""
        return wp.vec3(kept_number(stack, at), kept_number(stack, at + 1), kept_number(stack, at + 2))

    @without_gradient
    @wp.func
    def prepare(ray: RayFrame, stack: stack_argument):
        """Keep what the test needs of a ray."""
        axes = axes_of(ray.longest_axis)
        store_word(stack, kept, wp.uint32(ray.longest_axis))
        for i in range(3):
            store_word(stack, kept + 1 + i, wp.cast(ray.origin[i], wp.uint32))
            store_word(stack, kept + 4 + i, wp.cast(ray.given_direction[i], wp.uint32))
        store_word(stack, kept + 7, wp.cast(ray.given_tmin, wp.uint32))
        store_word(stack, kept + 8, wp.cast(ray.given_tmax, wp.uint32))
        store_word(stack, kept + 9, wp.cast(1.0 / ray.scale, wp.uint32))
        inverse = wp.float64(1.0) / wp.float64(component(ray.given_direction, axes[2]))
        for i in range(2):
            slope = wp.float64(component(ray.given_direction, axes[i])) * inverse
            store_double(stack, kept + 10 + 2 * i, slope_of(slope))
        store_double(stack, kept + 14, inverse)

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
        """The lanes whose triangle the ray's line may meet, one bit each."""
        axes = axes_of(int(load_word(stack, kept)))
        origin = kept_vector(stack, 1)
        shear_x = load_double(stack, kept + 10)
        shear_y = load_double(stack, kept + 12)
        stride = stride_of(units, block)
        found = wp.uint32(0)
        for i in range(length):
            at = vertices_of(units, block, wp.where(length == 1, lane & 3, i))
            if may_meet(units, at, stride, axes, origin, shear_x, shear_y):
                found = found | wp.uint32(1 << i)
        return used(units, block, lane, found)

    @without_gradient
    @wp.func(inline=False)
    def solve(units: wp.uint64, block: int, j: int, stack: stack_argument, best_t: float, crossings: bool):
        """t, u, v and 1; a 0 last where the ray misses the triangle or meets it outside its limits.

        Also where it meets it beyond best_t, in the caller's units.
        """
        at = vertices_of(units, block, j)
        stride = stride_of(units, block)
        origin = kept_vector(stack, 1)
        direction = kept_vector(stack, 4)
        hit = solve_exactly(
            units,
            at,
            stride,
            axes_of(int(load_word(stack, kept))),
            origin,
            direction,
            load_double(stack, kept + 10),
            load_double(stack, kept + 12),
            load_double(stack, kept + 14),
            kept_number(stack, 7),
            wp.min(best_t, kept_number(stack, 8)),
            crossings,
        )
        if hit[3] != 0.0 and not lies_within(
            units, at, stride, origin, direction, hit[0], kept_number(stack, 7), kept_number(stack, 8)
        ):
            hit[3] = 0.0
        return hit

    @without_gradient
    @wp.func(inline=False)
    def comes_before(
        units: wp.uint64, place: int, prim: int, other: int, other_prim: int, stack: stack_argument
    ):
        """Whether a hit whose t rounds to the same as another's is nearer, or as near and of a lower prim."""
        block = block_of(place)
        other_block = block_of(other)
        order = compare_distances(
            units,
            vertices_of(units, block, place - block),
            stride_of(units, block),
            vertices_of(units, other_block, other - other_block),
            stride_of(units, other_block),
            kept_vector(stack, 1),
            kept_vector(stack, 4),
        )
        return order < 0 or (order == 0 and prim < other_prim)

    @without_gradient
    @wp.func
    def take_closest(
        best: ExactBest, units: wp.uint64, place: int, stack: stack_argument, hit: wp.vec4, prim: int
    ):
        """The nearest hit; of hits at the same t, the lowest prim."""
        nearer = best.prim == wp.static(NO_PRIM) or hit[0] < best.given_t
        if not nearer and hit[0] == best.given_t:
            nearer = comes_before(units, place, prim, best.place, best.prim, stack)
        if nearer:
            best.given_t = hit[0]
            best.u = hit[1]
            best.v = hit[2]
            best.prim = prim
            best.place = place
            # Boxes are lowered by more than t was rounded, except where t is a subnormal number.
            best.t = product(hit[0] + SUBNORMAL_STEP, kept_number(stack, 9))
        return best

    @without_gradient
    @wp.func
    def settle(units: wp.uint64, stack: stack_argument, lane: int, best: ExactBest):
        """Take the hits of a ray's threads but one for no hits: the best of all."""
        rivals = or_reduce(wp.where(best.prim == wp.static(NO_PRIM), wp.uint32(0), wp.uint32(1 << lane)))
        beaten = bool(False)  # noqa: UP018
        while rivals != wp.uint32(0):
            i = lowest_lane(rivals)
            rivals = rivals & (rivals - wp.uint32(1))
            t = wp.cast(
                or_reduce(wp.where(lane == i, wp.cast(best.given_t, wp.uint32), wp.uint32(0))), wp.float32
            )
            place = int(or_reduce(wp.where(lane == i, wp.uint32(best.place), wp.uint32(0))))
            prim = int(or_reduce(wp.where(lane == i, wp.uint32(best.prim), wp.uint32(0))))
            if lane != i and best.prim != wp.static(NO_PRIM):
                if t < best.given_t:
                    beaten = True
                if t == best.given_t and comes_before(units, place, prim, best.place, best.prim, stack):
                    beaten = True
        if beaten:
            best.prim = wp.static(NO_PRIM)
        return best

    return SimpleNamespace(
        prepare=prepare, candidates=candidates, solve=solve, take_closest=take_closest, settle=settle
    )


def make_exact_leaf_test(
    asked: SimpleNamespace,
    lanes: SimpleNamespace,
    form: SimpleNamespace,
    triangles: SimpleNamespace,
    leaf_type: type,
) -> wp.Function:
    """The test of a leaf's blocks in exact trees: one thread takes all, or eight a triangle each."""
    stack_argument = lanes.stack_argument
    candidates, solve = triangles.candidates, triangles.solve
    take, take_closest, done = asked.take, triangles.take_closest, asked.done
    compares: bool = take is None
    crossings: bool = asked.crossings
    best_type = asked.state
    prim_at, block_at = form.prim_at, form.block_at
    length: int = lanes.triangles_length
    block_step: int = lanes.block_step

    @without_gradient
    @wp.func
    def test_leaf(
        units: wp.uint64,
        begin: int,
        blocks: int,
        lane: int,
        stack: stack_argument,
        tmin: float,
        best: best_type,
    ) -> leaf_type:
        leaf = leaf_type()
        leaf.best = best
        leaf.last = 7
        i = int(lane // wp.static(BLOCK_WIDTH))
        while i < blocks:
            block = block_at(units, begin, i)
            left = wp.uint32(candidates(units, block, lane, stack))
            while left != wp.uint32(0):
                j = lowest_lane(left)
                left = left & (left - wp.uint32(1))
                triangle = wp.where(length == 1, lane & 3, j)
                prim = wp.cast(load_float(units, prim_at(units, block, triangle)), wp.int32)
                best_t = float(wp.inf)
                if wp.static(compares):
                    best_t = leaf.best.given_t
                hit = solve(units, block, triangle, stack, best_t, crossings)
                if hit[3] != 0.0:
                    if wp.static(compares):
                        leaf.best = take_closest(leaf.best, units, block + triangle, stack, hit, prim)
                    else:
                        leaf.best = take(leaf.best, hit, prim)
            if done(leaf.best):
                leaf.last = i
                break
            i += block_step
        return leaf

    return test_leaf
