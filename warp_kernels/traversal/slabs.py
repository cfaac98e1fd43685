"""A visit of an inner node: the four steps of the paper, once for both lane forms and both node forms."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.queries.frame import box_tmin


def make_visit(
    lanes: SimpleNamespace, nodes: SimpleNamespace, stack_size: int, in_order: bool, frame_type: type
) -> wp.Function:
    """The visit for a lane form, node form and ray frame.

    stack_size: children that the stack holds; if in_order, their distances are that many words behind.
    in_order: whether the nearest child goes on top.
    """
    length = lanes.length
    vector = lanes.vector
    distances, load_ranks, has_child = nodes.distances, nodes.ranks, nodes.has_child
    child_row: int = nodes.child_row
    rank_bits: int = nodes.rank_bits
    load_row = lanes.load_row
    or_reduce = lanes.or_reduce
    stack_argument = lanes.stack_argument
    store_word = lanes.store_word

    @wp.func
    def place_of(rank: wp.uint32, shift: wp.uint32, slot: int):
        """A child's place on the stack as one bit, the farthest lowest; its slot if order does not matter."""
        if wp.static(in_order):
            return wp.uint32(1) << ((rank >> shift) & wp.uint32(7))
        return wp.uint32(1) << wp.uint32(slot)

    @without_gradient
    @wp.func
    def visit(
        units: wp.uint64,
        node: int,
        lane: int,
        ray: frame_type,
        tmax: float,
        stack: stack_argument,
        top: int,
    ):
        """Store at `top` the children hit within [tmin, tmax], the nearest last; return their number."""
        # (A) order: octant 7 - o is octant o backwards, and the stack needs the farthest child first.
        shift = wp.uint32(rank_bits * (7 - ray.octant))
        ranks = load_ranks(units, node, lane)
        children = load_row(units, node + child_row, lane)
        # (B) slabs: rows are lo.x hi.x lo.y hi.y lo.z hi.z; the ray's sign picks the near one of each pair.
        x = ray.octant & 1
        y = (ray.octant >> 1) & 1
        z = ray.octant >> 2
        r = ray.rdir
        b = ray.near_bias
        near_x = distances(units, node, lane, 0, x, r[0], b[0])
        near_y = distances(units, node, lane, 1, 2 + y, r[1], b[1])
        near_z = distances(units, node, lane, 2, 4 + z, r[2], b[2])
        b = ray.far_bias
        far_x = distances(units, node, lane, 0, 1 - x, r[0], b[0])
        far_y = distances(units, node, lane, 1, 3 - y, r[1], b[1])
        far_z = distances(units, node, lane, 2, 5 - z, r[2], b[2])
        tnear = wp.max(wp.max(near_x, near_y), wp.max(near_z, vector(box_tmin(ray))))
        tfar = wp.min(wp.min(far_x, far_y), wp.min(far_z, vector(tmax)))
        # (C) compress: the bits of the places hit; a hit goes above the hits with lower bits.
        own = wp.uint32(0)
        for i in range(length):
            met = tnear[i] <= tfar[i] and has_child(children[i])
            own = own | wp.where(met, place_of(ranks[i], shift, lane + i), wp.uint32(0))
        hits = or_reduce(own)
        # (D) store
        for i in range(length):
            place = place_of(ranks[i], shift, lane + i)
            if (own & place) != wp.uint32(0):
                at = top + wp.int32(wp.bit_count(hits & (place - wp.uint32(1))))
                store_word(stack, at, children[i])
                if wp.static(in_order):
                    store_word(stack, stack_size + at, wp.cast(tnear[i], wp.uint32))
        return wp.int32(wp.bit_count(hits))

    return visit
