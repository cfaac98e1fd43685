"""The two node forms (layout.h, compressed.h): what a visit reads of a node, for either lane form.

Both give the order of children alike: order(units, node, lane, octant) is what a visit needs of it, bit(...)
stands for a slot in a mask of hits, and before(...) is the number of hits that are farther than that slot's.
"""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.layout import (
    ALL_BITS,
    BEHIND_ROW,
    CHILD_ROW,
    COMPRESSED_CHILD_ROW,
    COMPRESSED_NODE_WORDS,
    COMPRESSED_RANK_BITS,
    NODE_WIDTH,
    NODE_WORDS,
)
from wive.warp_kernels.lanes.native import (
    BEHIND_1,
    BEHIND_8,
    BYTE_DISTANCES_1,
    BYTE_DISTANCES_8,
    RANKS_1,
    RANKS_8,
)


@wp.func
def _always(child: wp.uint32):
    return True


@wp.func
def _has_child(child: wp.uint32):
    return child != ALL_BITS


def float32_node(lanes: SimpleNamespace) -> SimpleNamespace:
    """Rows of floats; empty lanes hold boxes that nothing hits."""
    plane_distances = lanes.plane_distances
    eight: bool = lanes.length == 8

    @wp.func
    def distances(units: wp.uint64, node: int, lane: int, axis: int, row: int, rdir: float, bias: float):
        """Distances along the ray from its origin to a row of planes."""
        return plane_distances(units, node + NODE_WIDTH * row, lane, rdir, bias)

    @wp.func_native(BEHIND_8 if eight else BEHIND_1)
    def load_behind(units: wp.uint64, at: int, lane: int) -> wp.vec2ui: ...

    @wp.func
    def order(units: wp.uint64, node: int, lane: int, octant: int):
        """The slots behind each slot; those before it and itself, if the octant is one of the last four."""
        backwards = octant > 3
        behind = load_behind(units, node + BEHIND_ROW + 2 * wp.where(backwards, 7 - octant, octant), lane)
        flip = wp.where(backwards, ALL_BITS, wp.uint32(0))
        return wp.vec3ui(behind[0] ^ flip, behind[1] ^ flip, flip)

    @wp.func
    def bit(order: wp.vec3ui, i: int, slot: int):
        return wp.uint32(1) << wp.uint32(slot)

    @wp.func
    def before(order: wp.vec3ui, i: int, slot: int, hits: wp.uint32):
        behind = (order[i // 4] >> wp.uint32(8 * (i % 4))) & hits
        return wp.int32(wp.bit_count(behind)) + wp.int32(order[2])

    return SimpleNamespace(
        words=NODE_WORDS,
        distances=distances,
        order=order,
        order_type=wp.vec3ui,
        bits_are_slots=True,
        bit=bit,
        before=before,
        child_row=CHILD_ROW,
        has_child=_always,
    )


def compressed_node(lanes: SimpleNamespace) -> SimpleNamespace:
    """Rows of bytes on a grid given by an origin and three steps; empty lanes have no child."""
    vector, words = lanes.vector, lanes.words
    length: int = lanes.length
    eight: bool = lanes.length == 8

    @wp.func_native(BYTE_DISTANCES_8 if eight else BYTE_DISTANCES_1)
    def distances(
        units: wp.uint64, node: int, lane: int, axis: int, row: int, rdir: float, bias: float
    ) -> vector: ...

    @wp.func_native(RANKS_8 if eight else RANKS_1)
    def load_ranks(units: wp.uint64, node: int, lane: int) -> words: ...

    @wp.func
    def order(units: wp.uint64, node: int, lane: int, octant: int):
        """The farthest child gets the lowest place."""
        shift = wp.uint32(COMPRESSED_RANK_BITS * (7 - octant))
        ranks = load_ranks(units, node, lane)
        for i in range(length):
            ranks[i] = (ranks[i] >> shift) & wp.uint32(7)
        return ranks

    @wp.func
    def bit(order: words, i: int, slot: int):
        return wp.uint32(1) << order[i]

    @wp.func
    def before(order: words, i: int, slot: int, hits: wp.uint32):
        return wp.int32(wp.bit_count(hits & (bit(order, i, slot) - wp.uint32(1))))

    return SimpleNamespace(
        words=COMPRESSED_NODE_WORDS,
        distances=distances,
        order=order,
        order_type=words,
        bits_are_slots=False,
        bit=bit,
        before=before,
        child_row=COMPRESSED_CHILD_ROW,
        has_child=_has_child,
    )


NODES = {"float32": float32_node, "compressed": compressed_node}
