"""The WiVe traversal of the 8-wide tree, one ray at a time, as cpu/traverse/traversal.h.

Fuetterling, Lojewski, Pfreundt, Hamann, Ebert: "Accelerated Single Ray Tracing for Wide Vector Units", HPG
2017. The paper's four steps (A) order, (B) slabs, (C) compress, (D) store are in slabs.py.
"""

import functools
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.lanes import address_of, lanes_of, without_gradient
from wive.warp_kernels.lanes.layout import ALL_BITS, END_OF_STACK, NO_PRIM, NODE_WIDTH, WORD_MASK
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import FRAMES, box_tmax
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.leaf import make_count, make_leaf_test, make_offer
from wive.warp_kernels.traversal.nearest import keep_nearest_double, sortable, unsortable
from wive.warp_kernels.traversal.slabs import make_visit
from wive.warp_kernels.traversal.states import TRAVERSALS
from wive.warp_kernels.tree.blocks import block_form
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES
from wive.warp_kernels.tree.nodes import NODES
from wive.warp_kernels.triangles import (
    triangle_exact,
    triangle_fast,
    triangle_watertight,
    triangle_watertight_float64,
)
from wive.warp_kernels.triangles.triangle_exact import make_exact_offer

# The triangle test of each accuracy and precision, and the words that it keeps of a ray.
TRIANGLES = {
    ("fast", "float32"): (triangle_fast.fast_triangles, triangle_fast.RAY_NUMBERS),
    ("fast", "float64"): (triangle_fast.fast_triangles, 2 * triangle_fast.RAY_NUMBERS),
    ("watertight", "float32"): (triangle_watertight.watertight_triangles, triangle_watertight.RAY_WORDS),
    ("watertight", "float64"): (
        triangle_watertight_float64.watertight_doubles,
        triangle_watertight_float64.RAY_WORDS,
    ),
    ("exact", "float32"): (triangle_exact.exact_triangles, triangle_exact.RAY_WORDS),
}


@functools.cache
def make_traversal(
    query: str,
    accuracy: str,
    length: int,
    stack_size: int,
    counters: bool,
    nodes: str = "float32",
    precision: str = "float32",
) -> wp.Function:
    """The traversal for a query, accuracy, lane form, stack size, node form and precision.

    traverse(tree, ray, lane, found) continues from the state `found` and returns one of TRAVERSALS. Its stack
    holds `stack_size` children, behind them their distances if the query is in order, and behind these what
    the triangle test keeps of the ray.
    """
    query_type = query_of(query, accuracy, precision)
    in_order: bool = query_type.in_order
    first_hit_ends: bool = query_type.first_hit_ends
    make_triangles, ray_words = TRIANGLES[accuracy, precision]
    ray_base = stack_size * (2 if in_order else 1)
    lanes = lanes_of(length, ray_base + ray_words, precision)
    blocks, node = block_form(lanes, nodes, precision), NODES[nodes](lanes)
    triangles = make_triangles(lanes, blocks, ray_base, precision, query_type.crossings)
    frame_type = FRAMES[precision]
    visit = make_visit(lanes, node, stack_size, in_order, frame_type)
    real = PRECISIONS[precision].real
    offer = (make_exact_offer if accuracy == "exact" else make_offer)(query_type, lanes, triangles, real)
    test_leaf = make_leaf_test(query_type, lanes, blocks, triangles.candidates, offer, real)
    count_triangles = make_count(blocks)
    node_words: int = node.words
    block_words: int = blocks.least_words
    tree_type, found_type = HANDLES[accuracy, precision], query_type.state
    result_type = TRAVERSALS[found_type]
    # Hits of a ray's threads whose t round to the same float32 number are compared once more at the end.
    compares: bool = in_order and length == 1 and (accuracy == "exact" or precision == "float64")
    keep_nearest: Any = None
    if compares:
        keep_nearest = triangles.keep_nearest if accuracy == "exact" else keep_nearest_double(lanes)
    prepare = triangles.prepare
    new_stack, sync = lanes.new_stack, lanes.sync
    store_word, load_word = lanes.store_word, lanes.load_word
    or_reduce, min_reduce = lanes.or_reduce, lanes.min_reduce

    @without_gradient
    @wp.func
    def traverse(tree: tree_type, ray: frame_type, lane: int, found: found_type) -> result_type:
        units = address_of(tree.units)
        words = wp.uint32(tree.units.shape[0])
        result = result_type()
        result.found = found
        result.tmax = box_tmax(ray.tmax)
        stack = new_stack()
        prepare(ray, stack)
        # The bottom of the stack is always near enough to be popped, and its child ends the traversal.
        store_word(stack, 0, ALL_BITS)
        if wp.static(in_order):
            store_word(stack, stack_size, wp.cast(-wp.inf, wp.uint32))
        # int() makes variables of what Warp would take for constants.
        top = int(1)
        child = int(0)
        steps = int(0)
        sync()
        while child != END_OF_STACK:
            begin = child & WORD_MASK
            inner = child >= 0
            block_count = (child & 7) + 1
            end = wp.uint32(begin) + wp.uint32(wp.where(inner, node_words, block_count * block_words))
            steps += 1
            if steps > tree.step_limit or top > wp.static(stack_size - NODE_WIDTH) or end > words:
                tree.error[CORRUPTION] = 1
                break
            if inner:
                top += visit(units, begin, lane, ray, result.tmax, stack, top) - 1
                sync()
                if wp.static(counters):
                    result.inner_nodes += 1
            else:
                leaf = test_leaf(units, begin, block_count, lane, stack, ray.tmin, result.found)
                result.found = leaf.found
                if wp.static(counters):
                    result.leaves += 1
                    last = int(min_reduce(wp.uint32(leaf.last)))
                    result.triangles += count_triangles(units, begin, wp.min(block_count, last + 1))
                if wp.static(in_order):
                    result.tmax = unsortable(min_reduce(sortable(box_tmax(result.found.t))))
                if wp.static(first_hit_ends):
                    hit = wp.where(result.found.prim != NO_PRIM, wp.uint32(1), wp.uint32(0))
                    if or_reduce(hit) != wp.uint32(0):
                        break
                top -= 1
            child = wp.cast(load_word(stack, top), wp.int32)
            if wp.static(in_order):
                # Pop the children that are now behind the best hit.
                while wp.cast(load_word(stack, stack_size + top), wp.float32) > result.tmax:
                    top -= 1
                    child = wp.cast(load_word(stack, top), wp.int32)
            sync()
        if wp.static(compares):
            result.found = keep_nearest(units, stack, lane, result.found)
            own = wp.where(result.found.prim == NO_PRIM, wp.inf, box_tmax(result.found.t))
            result.tmax = unsortable(min_reduce(sortable(own)))
        return result

    return traverse
