"""The two node forms (layout.h, compressed.h): what a visit reads of a node, for either lane form."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.layout import (
    ALL_BITS,
    CHILD_ROW,
    COMPRESSED_CHILD_ROW,
    COMPRESSED_NODE_WORDS,
    COMPRESSED_RANK_BITS,
    NODE_WIDTH,
    NODE_WORDS,
    RANK_BITS,
    RANK_ROW,
)
from wive.warp_kernels.lanes.native import BYTE_DISTANCES_1, BYTE_DISTANCES_8, RANKS_1, RANKS_8


@wp.func
def _always(child: wp.uint32):
    return True


@wp.func
def _has_child(child: wp.uint32):
    return child != ALL_BITS


def float32_node(lanes: SimpleNamespace) -> SimpleNamespace:
    """Rows of floats; empty lanes hold boxes that nothing hits."""
    plane_distances, load_row = lanes.plane_distances, lanes.load_row

    @wp.func
    def distances(units: wp.uint64, node: int, lane: int, axis: int, row: int, rdir: float, bias: float):
        """Distances along the ray from its origin to a row of planes."""
        return plane_distances(units, node + NODE_WIDTH * row, lane, rdir, bias)

    @wp.func
    def ranks(units: wp.uint64, node: int, lane: int):
        """Each child's place in the order of every octant."""
        return load_row(units, node + RANK_ROW, lane)

    return SimpleNamespace(
        words=NODE_WORDS,
        distances=distances,
        ranks=ranks,
        rank_bits=RANK_BITS,
        child_row=CHILD_ROW,
        has_child=_always,
    )


def compressed_node(lanes: SimpleNamespace) -> SimpleNamespace:
    """Rows of bytes on a grid given by an origin and three steps; empty lanes have no child."""
    vector, words = lanes.vector, lanes.words
    eight: bool = lanes.length == 8

    @wp.func_native(BYTE_DISTANCES_8 if eight else BYTE_DISTANCES_1)
    def distances(
        units: wp.uint64, node: int, lane: int, axis: int, row: int, rdir: float, bias: float
    ) -> vector: ...

    @wp.func_native(RANKS_8 if eight else RANKS_1)
    def ranks(units: wp.uint64, node: int, lane: int) -> words: ...

    return SimpleNamespace(
        words=COMPRESSED_NODE_WORDS,
        distances=distances,
        ranks=ranks,
        rank_bits=COMPRESSED_RANK_BITS,
        child_row=COMPRESSED_CHILD_ROW,
        has_child=_has_child,
    )


NODES = {"float32": float32_node, "compressed": compressed_node}
