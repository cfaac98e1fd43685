"""A visit of an inner node: the four steps of the paper, once for both lane forms and both node forms."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import byte_of, without_gradient
from wive.warp_kernels.lanes.precision import stack_numbers
from wive.warp_kernels.lanes.vectors import make_bits, make_larger, make_smaller
from wive.warp_kernels.queries.frame import box_tmax, box_tmin

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


def make_meets_tree(frame_type: type) -> wp.Function:
    """The function that says whether a ray meets the box of a tree, by the slab test of nodes.

    The box is moved outwards by more than the planes of nodes are (plane_slack_factor in
    cpu/build/write_node.h), so all rays that meet a box inside pass: distances to planes, rounded, keep the
    planes' order.
    """
    slack_factor = 2.0**-19

    @without_gradient
    @wp.func
    def meets_tree(extent: wp.vec3, ray: frame_type):
        entry = box_tmin(ray)
        exit = box_tmax(ray.tmax)
        slack = slack_factor * wp.max(wp.max(extent[0], extent[1]), extent[2])
        for axis in range(3):
            reach = (extent[axis] + slack) * wp.abs(ray.rdir[axis])
            near = ray.near_bias[axis] - reach
            far = reach + ray.far_bias[axis]
            entry = wp.where(near > entry, near, entry)
            exit = wp.where(far < exit, far, exit)
        return entry <= exit

    return meets_tree


def make_visit(
    lanes: SimpleNamespace, nodes: SimpleNamespace, entries: SimpleNamespace, box_base: int, in_order: bool
) -> wp.Function:
    """The visit for a lane form, node form and the entries of a stack.

    box_base: the stack word from which on `make_keep` has kept the ray. in_order: whether the nearest child
    goes on top.
    """
    numbers = stack_numbers(lanes, "float32", box_base)
    load, load_word = numbers.load, lanes.load_word
    vector, words = lanes.vector, lanes.words
    grid_of, distances, used = nodes.grid, nodes.distances, nodes.used
    order_of, below, lowest = nodes.order, nodes.below, nodes.lowest
    store_hits = entries.store_hits
    child_row: int = nodes.child_row
    load_row, collect = lanes.load_row, lanes.group_vote
    stack_argument = lanes.stack_argument
    alone: bool = lanes.length == 8

    larger, smaller = make_larger(vector), make_smaller(vector)
    met = make_bits(vector, ("low", "<=", "high"))

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
        store_hits(stack, lowest(order, top), below(order, hits), own, children, tnear, lane)
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
            r = wp.vec3(load(stack, RDIR), load(stack, RDIR + 1), load(stack, RDIR + 2))
            near = wp.vec3(load(stack, NEAR_BIAS), load(stack, NEAR_BIAS + 1), load(stack, NEAR_BIAS + 2))
            far = wp.vec3(load(stack, FAR_BIAS), load(stack, FAR_BIAS + 1), load(stack, FAR_BIAS + 2))
            tmin = load(stack, BOX_TMIN)
            near_x, far_x = distances(
                units, node, grid, lane, 0, byte_of(rows, 0), r[0], r[0], near[0], far[0]
            )
            near_y, far_y = distances(
                units, node, grid, lane, 1, byte_of(rows, 1), r[1], r[1], near[1], far[1]
            )
            near_z, far_z = distances(
                units, node, grid, lane, 2, byte_of(rows, 2), r[2], r[2], near[2], far[2]
            )
            tnear = larger(larger(near_x, near_y), larger(near_z, vector(tmin)))
            tfar = smaller(smaller(far_x, far_y), smaller(far_z, vector(tmax)))
            # (C) compress: a bit for each child hit.
            own = met(tnear, tfar, lane) & used(grid)
            if wp.static(alone):
                count = push(own, own, order, children, tnear, lane, stack, top)
        if wp.static(not alone):
            hits = collect(own)
            count = push(own, hits, order, children, tnear, lane, stack, top)
        return count

    return visit
