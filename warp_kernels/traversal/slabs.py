"""A visit of an inner node: the four steps of the paper, once for both lane forms and both node forms."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import byte_of, without_gradient
from wive.warp_kernels.lanes.native import set_bit_if
from wive.warp_kernels.lanes.precision import stack_numbers
from wive.warp_kernels.queries.frame import box_tmin

# What visits read of a ray, in words: one over its direction, the biases of near and far planes (three each),
# tmin, and where its rows begin in nodes. They are kept in the stack's memory, because a traversal has few
# registers to spare between visits.
RDIR = 0
NEAR_BIAS = 3
FAR_BIAS = 6
BOX_TMIN = 9
ROWS = 10
BOX_WORDS = 11


def make_keep(lanes: SimpleNamespace, nodes: SimpleNamespace, box_base: int, frame_type: type) -> wp.Function:
    """The function that keeps what visits need of a ray, from stack word `box_base` on."""
    numbers = stack_numbers(lanes, "float32", box_base)
    store, store_word, stack_argument = numbers.store, lanes.store_word, lanes.stack_argument
    rows_of = nodes.rows_of

    @without_gradient
    @wp.func
    def keep(ray: frame_type, stack: stack_argument):
        for axis in range(3):
            store(stack, RDIR + axis, ray.rdir[axis])
            store(stack, NEAR_BIAS + axis, ray.near_bias[axis])
            store(stack, FAR_BIAS + axis, ray.far_bias[axis])
        store(stack, BOX_TMIN, box_tmin(ray))
        store_word(stack, box_base + ROWS, rows_of(ray.octant))

    return keep


@wp.func_native(set_bit_if(("near", "<=", "far")))
def with_bit_if_met(mask: wp.uint32, bit: wp.uint32, near: float, far: float) -> wp.uint32:
    """The mask with the bit if a ray that enters a box at `near` and leaves it at `far` meets it."""
    ...


def make_visit(
    lanes: SimpleNamespace, nodes: SimpleNamespace, entries: SimpleNamespace, box_base: int, in_order: bool
) -> wp.Function:
    """The visit for a lane form, node form and the entries of a stack.

    box_base: the stack word from which on `make_keep` has kept the ray. in_order: whether the nearest child
    goes on top.
    """
    numbers = stack_numbers(lanes, "float32", box_base)
    load, load_vector, load_word = numbers.load, numbers.load_vector, lanes.load_word
    length = lanes.length
    vector, words = lanes.vector, lanes.words
    grid_of, distances, used = nodes.grid, nodes.distances, nodes.used
    order_of, below, lowest = nodes.order, nodes.below, nodes.lowest
    store_if = entries.store_if
    child_row: int = nodes.child_row
    load_row, collect = lanes.load_row, lanes.group_vote
    stack_argument = lanes.stack_argument
    alone: bool = lanes.length == 8

    @wp.func
    def slots_below(lane: int):
        """An order in which each slot goes above the lower ones."""
        if wp.static(alone):
            return wp.vec3ui(wp.uint32(0x07030100), wp.uint32(0x7F3F1F0F), wp.uint32(0))
        return wp.vec3ui((wp.uint32(1) << wp.uint32(lane)) - wp.uint32(1), wp.uint32(0), wp.uint32(0))

    @without_gradient
    @wp.func
    def push(
        own: wp.uint32,
        hits: wp.uint32,
        order: wp.vec3ui,
        children: words,
        tnear: vector,
        lane: int,
        stack: stack_argument,
        top: int,
    ):
        """(D) store: a hit goes above those that are farther."""
        farther = below(order, hits)
        first = lowest(order, top)
        for i in range(length):
            hit = own & (wp.uint32(1) << wp.uint32(lane + i))
            behind = farther[i // 4] & wp.uint32(255 << (8 * (i % 4)))
            store_if(stack, first, behind, hit, children[i], tnear[i])
        return wp.int32(wp.bit_count(hits))

    @without_gradient
    @wp.func
    def visit(
        units: wp.uint64,
        node: int,
        lane: int,
        tmax: float,
        stack: stack_argument,
        top: int,
        goes: bool,
    ):
        """Store at `top` the children hit within [tmin, tmax], the nearest last; return their number.

        All threads of a warp call it; those that do not go have no children.
        """
        order = wp.vec3ui()
        children = words()
        tnear = vector()
        own = wp.uint32(0)
        count = int(0)
        if goes:
            # (A) order: the stack needs the farthest child first.
            rows = load_word(stack, box_base + ROWS)
            order = slots_below(lane)
            if wp.static(in_order):
                order = order_of(units, node, lane, rows)
            children = load_row(units, node, child_row, lane)
            # (B) slabs: the ray's octant says which row of an axis has its near planes.
            grid = grid_of(units, node)
            r = load_vector(stack, RDIR)
            near = load_vector(stack, NEAR_BIAS)
            far = load_vector(stack, FAR_BIAS)
            tmin = load(stack, BOX_TMIN)
            near_x, far_x = distances(
                units, node, grid, lane, 0, byte_of(rows, 0), wp.vec2(r[0], r[0]), wp.vec2(near[0], far[0])
            )
            near_y, far_y = distances(
                units, node, grid, lane, 1, byte_of(rows, 1), wp.vec2(r[1], r[1]), wp.vec2(near[1], far[1])
            )
            near_z, far_z = distances(
                units, node, grid, lane, 2, byte_of(rows, 2), wp.vec2(r[2], r[2]), wp.vec2(near[2], far[2])
            )
            tnear = wp.max(wp.max(near_x, near_y), wp.max(near_z, vector(tmin)))
            tfar = wp.min(wp.min(far_x, far_y), wp.min(far_z, vector(tmax)))
            # (C) compress: a bit for each child hit.
            for i in range(length):
                own = with_bit_if_met(own, wp.uint32(1) << wp.uint32(lane + i), tnear[i], tfar[i])
            own = own & used(grid)
            if wp.static(alone):
                count = push(own, own, order, children, tnear, lane, stack, top)
        if wp.static(not alone):
            hits = collect(own)
            count = push(own, hits, order, children, tnear, lane, stack, top)
        return count

    return visit
