"""A visit of an inner node: the four steps of the paper, once for both lane forms."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.frame import RayFrame
from wive.warp_kernels.handle import CHILD_ROW, RANK_ROW
from wive.warp_kernels.lanes import without_gradient


def make_visit(lanes: SimpleNamespace, entries: int, in_order: bool) -> wp.Function:
    """The visit for these lanes; entries: what the stack holds; in_order: whether the nearest goes on top."""
    length = lanes.length
    vector = lanes.vector
    plane_distances = lanes.plane_distances
    load_row = lanes.load_row
    or_reduce = lanes.or_reduce
    stack_argument = lanes.stack_argument
    store_word = lanes.store_word

    @wp.func
    def place_of(rank: wp.uint32, shift: wp.uint32, slot: int):
        """A child's place on the stack as one bit, the farthest lowest; its slot where order is nothing."""
        if wp.static(in_order):
            return wp.uint32(1) << ((rank >> shift) & wp.uint32(7))
        return wp.uint32(1) << wp.uint32(slot)

    @without_gradient
    @wp.func
    def visit(
        units: wp.uint64,
        node: int,
        lane: int,
        ray: RayFrame,
        tmax: float,
        stack: stack_argument,
        top: int,
    ):
        """Store at `top` the children met within [tmin, tmax], the nearest last; return how many."""
        # (A) order: octant 7 - o is octant o backwards, and the stack wants the farthest child first.
        shift = wp.uint32(4 * (7 - ray.octant))
        ranks = load_row(units, node + wp.static(RANK_ROW), lane)
        children = load_row(units, node + wp.static(CHILD_ROW), lane)
        # (B) slabs
        x = 8 * (ray.octant & 1)
        y = 8 * ((ray.octant >> 1) & 1)
        z = 8 * (ray.octant >> 2)
        r = ray.rdir
        b = ray.near_bias
        near_x = plane_distances(units, node + x, lane, r[0], b[0])
        near_y = plane_distances(units, node + 16 + y, lane, r[1], b[1])
        near_z = plane_distances(units, node + 32 + z, lane, r[2], b[2])
        b = ray.far_bias
        far_x = plane_distances(units, node + 8 - x, lane, r[0], b[0])
        far_y = plane_distances(units, node + 24 - y, lane, r[1], b[1])
        far_z = plane_distances(units, node + 40 - z, lane, r[2], b[2])
        tnear = wp.max(wp.max(near_x, near_y), wp.max(near_z, vector(ray.tmin)))
        tfar = wp.min(wp.min(far_x, far_y), wp.min(far_z, vector(tmax)))
        # (C) permute and compress: every lane's place, the hits among them, and how many hits lie below each
        own = wp.uint32(0)
        for i in range(length):
            own = own | wp.where(tnear[i] <= tfar[i], place_of(ranks[i], shift, lane + i), wp.uint32(0))
        hits = or_reduce(own)
        # (D) store
        for i in range(length):
            place = place_of(ranks[i], shift, lane + i)
            if (own & place) != wp.uint32(0):
                at = top + wp.int32(wp.bit_count(hits & (place - wp.uint32(1))))
                store_word(stack, at, children[i])
                if wp.static(in_order):
                    store_word(stack, entries + at, wp.cast(tnear[i], wp.uint32))
        return wp.int32(wp.bit_count(hits))

    return visit
