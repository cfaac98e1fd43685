"""WiVe: single-ray traversal of the 8-wide tree, as cpu/traverse/traversal.h.

Fuetterling, Lojewski, Pfreundt, Hamann, Ebert: "Accelerated Single Ray Tracing for Wide Vector Units", HPG
2017.
"""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import functools
from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import address_of, lanes_of, load_float, lowest_lane, without_gradient
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import FRAMES, box_tmax
from wive.warp_kernels.queries.query import QUERIES
from wive.warp_kernels.queries.query_exact import EXACT_QUERIES
from wive.warp_kernels.traversal.settling import settle_doubles, sortable, unsortable
from wive.warp_kernels.traversal.slabs import make_visit
from wive.warp_kernels.traversal.states import LEAVES, STATES
from wive.warp_kernels.tree.blocks import block_form
from wive.warp_kernels.tree.handle import (
    ALL_BITS,
    BLOCK_WIDTH,
    COMPRESSED_NODE_WORDS,
    CORRUPT,
    END_OF_STACK,
    HANDLES,
    NO_PRIM,
    NODE_WIDTH,
    NODE_WORDS,
    WORD_MASK,
)
from wive.warp_kernels.tree.nodes import NODES
from wive.warp_kernels.triangles import (
    triangle_exact,
    triangle_fast,
    triangle_watertight,
    triangle_watertight_float64,
)
from wive.warp_kernels.triangles.triangle_exact import make_exact_leaf_test

TRIANGLES = {
    ("fast", "float32"): (triangle_fast.fast_triangles, triangle_fast.KEPT_WORDS),
    ("fast", "float64"): (triangle_fast.double_triangles, 2 * triangle_fast.KEPT_WORDS),
    ("watertight", "float32"): (triangle_watertight.watertight_triangles, triangle_watertight.KEPT_WORDS),
    ("watertight", "float64"): (
        triangle_watertight_float64.watertight_doubles,
        triangle_watertight_float64.KEPT_WORDS,
    ),
    ("exact", "float32"): (triangle_exact.exact_triangles, triangle_exact.KEPT_WORDS),
}


@functools.cache
def make_traversal(
    query: str,
    accuracy: str,
    length: int,
    entries: int,
    counters: bool,
    nodes: str = "float32",
    precision: str = "float32",
) -> wp.Function:
    """The traversal for one query, accuracy, lane form, node form and precision.

    That many stack entries must do for the tree.
    """
    traverse_from = make_traversal_from(query, accuracy, length, entries, counters, nodes, precision)
    asked = query_of(query, accuracy, precision)
    begin, tree_type, state_type = asked.begin, HANDLES[accuracy], STATES[asked.state]
    frame_type = FRAMES[precision]

    @without_gradient
    @wp.func
    def traverse(tree: tree_type, ray: frame_type, lane: int) -> state_type:
        return traverse_from(tree, ray, lane, begin(ray))

    return traverse


@functools.cache
def make_traversal_from(
    query: str,
    accuracy: str,
    length: int,
    entries: int,
    counters: bool,
    nodes: str = "float32",
    precision: str = "float32",
) -> wp.Function:
    """The same, beginning with what its last argument holds."""
    asked = query_of(query, accuracy, precision)
    in_order: bool = asked.in_order
    make_triangles, kept_words = TRIANGLES[accuracy, precision]
    lanes = lanes_of(length, entries, in_order, kept_words, precision)
    blocks_form = block_form(lanes, nodes, precision)
    triangles = make_triangles(lanes, blocks_form, entries * (2 if in_order else 1))
    frame_type = FRAMES[precision]
    visit = make_visit(lanes, NODES[nodes](lanes), entries, in_order, frame_type)
    if accuracy == "exact":
        test_leaf = make_exact_leaf_test(asked, lanes, blocks_form, triangles, LEAVES[asked.state])
    else:
        test_leaf = make_leaf_test(asked, lanes, blocks_form, triangles, PRECISIONS[precision].real)
    count_triangles = make_count(blocks_form)
    node_words: int = NODE_WORDS if nodes == "float32" else COMPRESSED_NODE_WORDS
    block_words: int = blocks_form.least_words
    tree_type, best_type, state_type = HANDLES[accuracy], asked.state, STATES[asked.state]
    one_is_enough: bool = asked.one_is_enough
    # Where a ray's threads may hold hits whose t round to the same float, they settle which is the best.
    settles: bool = in_order and length == 1 and (accuracy == "exact" or precision == "float64")
    settle = (triangles.settle if accuracy == "exact" else settle_doubles(lanes)) if settles else None
    done = asked.done
    prepare = triangles.prepare
    new_stack, sync = lanes.new_stack, lanes.sync
    store_word, load_word = lanes.store_word, lanes.load_word
    or_reduce, min_reduce = lanes.or_reduce, lanes.min_reduce

    @without_gradient
    @wp.func
    def traverse_from(tree: tree_type, ray: frame_type, lane: int, best: best_type) -> state_type:
        units = address_of(tree.units)
        words = wp.uint32(tree.units.shape[0])
        state = state_type()
        state.best = best
        state.tmax = box_tmax(ray.tmax)
        stack = new_stack()
        prepare(ray, stack)
        # Below all others is an entry that is always near enough to be taken, and whose child ends the
        # traversal.
        store_word(stack, 0, ALL_BITS)
        if wp.static(in_order):
            store_word(stack, entries, wp.cast(-wp.inf, wp.uint32))
        # int() makes a variable of what would be a constant to Warp.
        top = int(1)  # noqa: RUF046, UP018
        child = int(0)  # noqa: RUF046, UP018
        steps = int(0)  # noqa: RUF046, UP018
        sync()
        while child != wp.static(END_OF_STACK):
            begin = child & wp.static(WORD_MASK)
            inner = child >= 0
            blocks = (child & 7) + 1
            end = wp.uint32(begin) + wp.uint32(wp.where(inner, node_words, blocks * block_words))
            steps += 1
            if steps > tree.step_limit or top > wp.static(entries - NODE_WIDTH) or end > words:
                tree.error[0] = wp.static(CORRUPT)
                break
            if inner:
                top += visit(units, begin, lane, ray, state.tmax, stack, top) - 1
                sync()
                if wp.static(counters):
                    state.inner_nodes += 1
            else:
                tested = test_leaf(units, begin, blocks, lane, stack, ray.tmin, state.best)
                state.best = tested.best
                if wp.static(counters):
                    state.leaves += 1
                    last = int(min_reduce(wp.uint32(tested.last)))
                    state.triangles += count_triangles(units, begin, wp.min(blocks, last + 1))
                if wp.static(in_order):
                    state.tmax = unsortable(min_reduce(sortable(box_tmax(state.best.t))))
                if wp.static(one_is_enough):  # noqa: SIM102
                    if or_reduce(wp.where(done(state.best), wp.uint32(1), wp.uint32(0))) != wp.uint32(0):
                        break
                top -= 1
            child = wp.cast(load_word(stack, top), wp.int32)
            if wp.static(in_order):
                # Children that have come to lie behind the best hit are passed over.
                while wp.cast(load_word(stack, entries + top), wp.float32) > state.tmax:
                    top -= 1
                    child = wp.cast(load_word(stack, top), wp.int32)
            sync()
        if wp.static(settles):
            state.best = settle(units, stack, lane, state.best)
            own = wp.where(state.best.prim == wp.static(NO_PRIM), wp.inf, box_tmax(state.best.t))
            state.tmax = unsortable(min_reduce(sortable(own)))
        return state

    return traverse_from


def make_count(form: SimpleNamespace) -> wp.Function:
    """The count of the triangles that blocks of this form hold."""
    prim_at, block_at = form.prim_at, form.block_at

    @without_gradient
    @wp.func
    def count_triangles(units: wp.uint64, begin: int, blocks: int):
        count = int(0)  # noqa: RUF046, UP018
        for i in range(blocks):
            block = block_at(units, begin, i)
            for j in range(wp.static(BLOCK_WIDTH)):
                if wp.cast(load_float(units, prim_at(units, block, j)), wp.int32) >= 0:
                    count += 1
        return count

    return count_triangles


def query_of(query: str, accuracy: str, precision: str = "float32") -> SimpleNamespace:
    """What is asked of a tree of that accuracy and precision."""
    return (EXACT_QUERIES if accuracy == "exact" else QUERIES[precision])[query]


def make_leaf_test(
    asked: SimpleNamespace,
    lanes: SimpleNamespace,
    form: SimpleNamespace,
    triangles: SimpleNamespace,
    real: type,
) -> wp.Function:
    """The test of a leaf's blocks: one thread takes all, or eight a triangle each of two blocks at a time."""
    stack_argument = lanes.stack_argument
    candidates, solve = triangles.candidates, triangles.solve
    offer, done = asked.offer, asked.done
    best_type, leaf_type = asked.state, LEAVES[asked.state]
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
        tmin: real,
        best: best_type,
    ) -> leaf_type:
        leaf = leaf_type()
        leaf.best = best
        leaf.last = 7
        i = int(lane // wp.static(BLOCK_WIDTH))
        while i < blocks:
            block = block_at(units, begin, i)
            found = candidates(units, block, lane, stack)
            left = wp.uint32(found[0])
            while left != wp.uint32(0):
                j = lowest_lane(left)
                negative = ((found[1] >> wp.uint32(j)) & wp.uint32(1)) != wp.uint32(0)
                left = left & (left - wp.uint32(1))
                triangle = wp.where(length == 1, lane & 3, j)
                prim = wp.cast(load_float(units, prim_at(units, block, triangle)), wp.int32)
                leaf.best = offer(leaf.best, tmin, solve(units, block, triangle, stack, negative), prim)
            if done(leaf.best):
                leaf.last = i
                break
            i += block_step
        return leaf

    return test_leaf
