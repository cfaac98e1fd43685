"""A visit of an inner node: the four steps of the paper, once for both lane forms and both node forms."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.precision import stack_numbers
from wive.warp_kernels.queries.frame import box_tmin

# What visits read of a ray, in words: one over its direction, the biases of near and far planes (three each),
# tmin, and the octant. They are kept in the stack's memory, because a traversal has few registers to spare
# between visits.
RDIR = 0
NEAR_BIAS = 3
FAR_BIAS = 6
BOX_TMIN = 9
OCTANT = 10
BOX_WORDS = 11


def make_keep(lanes: SimpleNamespace, box_base: int, frame_type: type) -> wp.Function:
    """The function that keeps what visits need of a ray, from stack word `box_base` on."""
    numbers = stack_numbers(lanes, "float32", box_base)
    store, store_word, stack_argument = numbers.store, lanes.store_word, lanes.stack_argument

    @without_gradient
    @wp.func
    def keep(ray: frame_type, stack: stack_argument):
        for axis in range(3):
            store(stack, RDIR + axis, ray.rdir[axis])
            store(stack, NEAR_BIAS + axis, ray.near_bias[axis])
            store(stack, FAR_BIAS + axis, ray.far_bias[axis])
        store(stack, BOX_TMIN, box_tmin(ray))
        store_word(stack, box_base + OCTANT, wp.uint32(ray.octant))

    return keep


def make_visit(
    lanes: SimpleNamespace, nodes: SimpleNamespace, stack_size: int, box_base: int, in_order: bool
) -> wp.Function:
    """The visit for a lane form and node form.

    stack_size: children that the stack holds; if in_order, their distances are that many words behind.
    box_base: the stack word from which on `make_keep` has kept the ray. in_order: whether the nearest child
    goes on top.
    """
    numbers = stack_numbers(lanes, "float32", box_base)
    load, load_vector, load_word = numbers.load, numbers.load_vector, lanes.load_word
    length = lanes.length
    vector, words = lanes.vector, lanes.words
    distances, order_of, has_child = nodes.distances, nodes.order, nodes.has_child
    bit, before, order_type = nodes.bit, nodes.before, nodes.order_type
    child_row: int = nodes.child_row
    load_row = lanes.load_row
    collect = lanes.group_vote if nodes.bits_are_slots or not in_order else lanes.or_reduce
    stack_argument = lanes.stack_argument
    store_word = lanes.store_word

    @wp.func
    def bit_of(order: order_type, i: int, slot: int):
        """A child in the mask of hits."""
        if wp.static(in_order):
            return bit(order, i, slot)
        return wp.uint32(1) << wp.uint32(slot)

    @wp.func
    def place_of(order: order_type, i: int, slot: int, hits: wp.uint32):
        """How many hits a child goes above: the farther ones, or those of lower slots."""
        if wp.static(in_order):
            return before(order, i, slot, hits)
        return wp.int32(wp.bit_count(hits & ((wp.uint32(1) << wp.uint32(slot)) - wp.uint32(1))))

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
        order = order_type()
        children = words()
        tnear = vector()
        own = wp.uint32(0)
        if goes:
            # (A) order: octant 7 - o is octant o backwards, and the stack needs the farthest child first.
            octant = int(load_word(stack, box_base + OCTANT))
            if wp.static(in_order):
                order = order_of(units, node, lane, octant)
            children = load_row(units, node + child_row, lane)
            # (B) slabs: rows are lo.x hi.x lo.y hi.y lo.z hi.z; the ray's sign picks the near one of a pair.
            x = octant & 1
            y = (octant >> 1) & 1
            z = octant >> 2
            r = load_vector(stack, RDIR)
            b = load_vector(stack, NEAR_BIAS)
            near_x = distances(units, node, lane, 0, x, r[0], b[0])
            near_y = distances(units, node, lane, 1, 2 + y, r[1], b[1])
            near_z = distances(units, node, lane, 2, 4 + z, r[2], b[2])
            b = load_vector(stack, FAR_BIAS)
            far_x = distances(units, node, lane, 0, 1 - x, r[0], b[0])
            far_y = distances(units, node, lane, 1, 3 - y, r[1], b[1])
            far_z = distances(units, node, lane, 2, 5 - z, r[2], b[2])
            tnear = wp.max(wp.max(near_x, near_y), wp.max(near_z, vector(load(stack, BOX_TMIN))))
            tfar = wp.min(wp.min(far_x, far_y), wp.min(far_z, vector(tmax)))
            # (C) compress: a bit for each child hit.
            for i in range(length):
                met = tnear[i] <= tfar[i] and has_child(children[i])
                own = own | wp.where(met, bit_of(order, i, lane + i), wp.uint32(0))
        hits = collect(own)
        # (D) store: a hit goes above those that are farther.
        for i in range(length):
            if (own & bit_of(order, i, lane + i)) != wp.uint32(0):
                at = top + place_of(order, i, lane + i, hits)
                store_word(stack, at, children[i])
                if wp.static(in_order):
                    store_word(stack, stack_size + at, wp.cast(tnear[i], wp.uint32))
        return wp.int32(wp.bit_count(hits))

    return visit
