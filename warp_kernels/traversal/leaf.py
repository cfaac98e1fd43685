"""The test of a leaf: its blocks' triangles, once for both lane forms and every triangle test."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.lanes import load_float, lowest_lane, without_gradient
from wive.warp_kernels.lanes.layout import BLOCK_WIDTH, MAX_LEAF_BLOCKS, NO_PRIM
from wive.warp_kernels.queries.query import Query
from wive.warp_kernels.traversal.states import LEAVES


def make_offer(
    query: Query, lanes: SimpleNamespace, triangles: SimpleNamespace, real: type, keep_uv: Any
) -> wp.Function:
    """The function that solves a triangle for t, u and v and offers them to the query.

    keep_uv: keeps u and v of a hit that is taken in the stack's memory; None if they are not needed there.
    """
    keeps_uv: bool = keep_uv is not None
    offer, solve, state_type = query.offer, triangles.solve, query.state
    keeps_place: bool = query.distance is not None
    stack_argument = lanes.stack_argument

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
        hit = solve(units, block, j, stack, negative)
        offered = offer(found, tmin, hit, prim)
        if wp.static(keeps_place):
            if offered.prim == prim:
                offered.place = block + j
                if wp.static(keeps_uv):
                    keep_uv(stack, hit[1], hit[2])
        return offered

    return offer_triangle


def make_leaf_test(
    query: Query,
    lanes: SimpleNamespace,
    blocks: SimpleNamespace,
    candidates: wp.Function,
    offer: wp.Function,
    real: type,
) -> wp.Function:
    """The leaf test: one thread tests all blocks, or eight test one triangle each, two blocks at a time.

    candidates: a block's lanes whose triangle the ray's line hits, and those that it passes clockwise.
    offer: offers one of these triangles to the query.
    """
    stack_argument = lanes.stack_argument
    state_type, leaf_type = query.state, LEAVES[query.state]
    first_hit_ends: bool = query.first_hit_ends
    prim_at, block_at = blocks.prim_at, blocks.block_at
    length: int = lanes.triangles_length
    block_step: int = lanes.block_step

    @without_gradient
    @wp.func
    def test_leaf(
        units: wp.uint64,
        begin: int,
        block_count: int,
        lane: int,
        stack: stack_argument,
        tmin: real,
        found: state_type,
    ) -> leaf_type:
        leaf = leaf_type()
        leaf.found = found
        leaf.last = MAX_LEAF_BLOCKS - 1
        i = int(lane // BLOCK_WIDTH)
        while i < block_count:
            block = block_at(units, begin, i)
            hit_masks = candidates(units, block, lane, stack)
            left = wp.uint32(hit_masks[0])
            while left != wp.uint32(0):
                j = lowest_lane(left)
                negative = ((hit_masks[1] >> wp.uint32(j)) & wp.uint32(1)) != wp.uint32(0)
                left = left & (left - wp.uint32(1))
                triangle = wp.where(length == 1, lane & 3, j)
                prim = wp.cast(load_float(units, prim_at(units, block, triangle)), wp.int32)
                leaf.found = offer(leaf.found, units, block, triangle, prim, negative, tmin, stack)
            if wp.static(first_hit_ends):
                if leaf.found.prim != NO_PRIM:
                    leaf.last = i
                    break
            i += block_step
        return leaf

    return test_leaf


def make_count(blocks: SimpleNamespace) -> wp.Function:
    """The number of triangles in the first blocks of a leaf."""
    prim_at, block_at = blocks.prim_at, blocks.block_at

    @without_gradient
    @wp.func
    def count_triangles(units: wp.uint64, begin: int, block_count: int):
        count = int(0)
        for i in range(block_count):
            block = block_at(units, begin, i)
            for j in range(BLOCK_WIDTH):
                if wp.cast(load_float(units, prim_at(units, block, j)), wp.int32) >= 0:
                    count += 1
        return count

    return count_triangles
