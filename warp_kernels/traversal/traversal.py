"""The WiVe traversal of the 8-wide tree, step by step, as cpu/traverse/traversal.h.

Fuetterling, Lojewski, Pfreundt, Hamann, Ebert: "Accelerated Single Ray Tracing for Wide Vector Units", HPG
2017. The paper's four steps (A) order, (B) slabs, (C) compress, (D) store are in slabs.py.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.entries import entries_of
from wive.warp_kernels.lanes.lanes import lanes_of, without_gradient
from wive.warp_kernels.lanes.layout import END_OF_STACK, NO_PRIM, NODE_WIDTH, WORD_MASK
from wive.warp_kernels.lanes.precision import PRECISIONS, stack_numbers
from wive.warp_kernels.queries.frame import FRAMES, box_tmax
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.leaf import make_count, make_leaf_test, make_offer
from wive.warp_kernels.traversal.nearest import keep_nearest_double, sortable, unsortable
from wive.warp_kernels.traversal.slabs import BOX_WORDS, make_keep, make_visit
from wive.warp_kernels.traversal.states import TRAVERSALS, Step
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

# What queries need of a ray, as numbers in the stack's memory.
TMIN = 0
UNSCALE = 1
U = 2
V = 3

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
def make_steps(
    query: str,
    accuracy: str,
    length: int,
    stack_size: int,
    counters: bool,
    nodes: str = "float32",
    precision: str = "float32",
) -> SimpleNamespace:
    """The steps of a traversal, for a query, accuracy, lane form, stack size, node form and precision.

    open(stack) comes first, and keep(ray, stack) before the steps of each ray. All threads of a warp take
    each step(...) together, to leaves or to inner nodes; those that are at the other or at their end keep
    their traversal as it is. settled(...) is what a thread has found at the end. What a step is made of is
    there for threads alone, whose loop is in alone.py.

    The stack, a new_stack(), holds `stack_size` entries, and behind them what triangle tests, visits and
    queries need of the ray.
    """
    query_type = query_of(query, accuracy, precision)
    in_order: bool = query_type.in_order
    first_hit_ends: bool = query_type.first_hit_ends
    make_triangles, ray_words = TRIANGLES[accuracy, precision]
    # A thread alone keeps u and v of the closest hit in memory: they change rarely.
    keeps_uv: bool = query == "closest" and length == 8 and accuracy != "exact"
    ray_base = stack_size * (2 if in_order else 1)
    # Both begin at even words: neighbours in a pair are stored and loaded together on CUDA.
    box_base = ray_base + ray_words + ray_words % 2
    own_base = box_base + BOX_WORDS + BOX_WORDS % 2
    own_numbers = 4 if keeps_uv else 2
    number_at = own_base + own_numbers * PRECISIONS[precision].words
    lanes = lanes_of(length, number_at + 1, precision)
    entries = entries_of(lanes, in_order)
    blocks, node = block_form(lanes, nodes, precision), NODES[nodes](lanes)
    triangles = make_triangles(lanes, blocks, ray_base, precision, query_type.crossings)
    frame_type = FRAMES[precision]
    keep_box = make_keep(lanes, node, box_base, frame_type)
    visit = make_visit(lanes, node, entries, box_base, in_order)
    stack_argument = lanes.stack_argument
    numbers = stack_numbers(lanes, precision, own_base)
    store, load = numbers.store, numbers.load
    real = PRECISIONS[precision].real

    @without_gradient
    @wp.func
    def keep_uv(stack: stack_argument, u: real, v: real):
        store(stack, U, u)
        store(stack, V, v)

    if accuracy == "exact":
        offer = make_exact_offer(query_type, lanes, triangles, real)
    else:
        offer = make_offer(query_type, lanes, triangles, real, keep_uv if keeps_uv else None)
    test_leaf = make_leaf_test(query_type, lanes, blocks, triangles.candidates, offer, real)
    count_triangles = make_count(blocks)
    tree_type, found_type = HANDLES[accuracy, precision], query_type.state
    walk_type = TRAVERSALS[found_type]
    # Hits of a ray's threads whose t round to the same float32 number are compared once more at the end.
    compares: bool = in_order and length == 1 and (accuracy == "exact" or precision == "float64")
    keep_nearest: Any = None
    if compares:
        keep_nearest = triangles.keep_nearest if accuracy == "exact" else keep_nearest_double(lanes)
    prepare, sync = triangles.prepare, lanes.sync
    store_word, load_word = lanes.store_word, lanes.load_word
    child_at, distance_at = entries.child, entries.distance
    group_vote, min_reduce = lanes.group_vote, lanes.min_reduce

    @without_gradient
    @wp.func
    def keep_for_boxes(ray: frame_type, stack: stack_argument):
        """Keep what visits, and limits of hits, need of a ray; leaves need what `prepare` keeps."""
        keep_box(ray, stack)
        store(stack, TMIN, ray.tmin)

    @without_gradient
    @wp.func
    def tmin(stack: stack_argument):
        return load(stack, TMIN)

    @without_gradient
    @wp.func
    def keep(ray: frame_type, stack: stack_argument):
        """Keep in the stack's memory what the steps need of a ray."""
        prepare(ray, stack)
        keep_for_boxes(ray, stack)
        store(stack, UNSCALE, ray.unscale)

    @without_gradient
    @wp.func
    def keep_number(stack: stack_argument, number: int):
        """Keep the number of the thread's ray: it is needed when the ray has ended."""
        store_word(stack, number_at, wp.uint32(number))

    @without_gradient
    @wp.func
    def number_kept(stack: stack_argument):
        return wp.int32(load_word(stack, number_at))

    one_limit: bool = length == 8 and precision == "float32" and query_type.limit is not None
    limit_of = query_type.limit

    @wp.func
    def limit(walk: walk_type):
        """tmax for boxes: of a thread alone that of its query, if it is a float32 number of the frame."""
        if wp.static(one_limit):
            return limit_of(walk.found)
        return walk.tmax

    @wp.func
    def goes_on(child: int, to_leaf: bool):
        """Above zero if a traversal at this child takes a step to leaves, or to inner nodes."""
        return wp.where(to_leaf, END_OF_STACK - child, child - END_OF_STACK)

    @wp.func
    def is_sound(tree: tree_type, steps: int, top: int, begin: int):
        """Whether a traversal may take a step to word `begin`: false if memory was overwritten."""
        if steps > tree.step_limit or top > wp.static(stack_size - NODE_WIDTH):
            return False
        return begin < tree.units.shape[0]

    @without_gradient
    @wp.func
    def nearest_left(stack: stack_argument, top: int, count: int, tmax: float):
        """The highest entry from `top` down that is not behind the best hit: one just put there never is."""
        found = int(top)
        if wp.static(in_order):
            if count == 0:
                while distance_at(stack, found) > tmax:
                    found -= 1
        return found

    # Structs are changed field by field: one that is assigned as a whole under a condition takes its
    # registers twice on CUDA. Numbers that change under conditions are fields: as variables they would be
    # selected anew behind each of them.

    @without_gradient
    @wp.func
    def step(
        tree: tree_type, units: wp.uint64, lane: int, stack: stack_argument, walk: walk_type, to_leaf: bool
    ) -> walk_type:
        """Test the triangles of a leaf or visit an inner node, and take the next child from the stack.

        A traversal that can't take the step ends, with an error.
        """
        begin = walk.child & WORD_MASK
        own = Step()
        own.goes = goes_on(walk.child, to_leaf)
        if own.goes > 0:
            walk.steps += 1
            if not is_sound(tree, walk.steps, walk.top, begin):
                tree.error[CORRUPTION] = 1
                walk.child = END_OF_STACK
                own.goes = 0
        if to_leaf:
            block_count = (walk.child & 7) + 1
            last = wp.uint32(0)
            if own.goes > 0:
                leaf = test_leaf(units, begin, block_count, lane, stack, tmin(stack), walk.found)
                walk.found = leaf.found
                last = wp.uint32(leaf.last)
            if wp.static(counters):
                last = min_reduce(last)
                if own.goes > 0:
                    walk.leaves += 1
                    walk.triangles += count_triangles(units, begin, wp.min(block_count, int(last) + 1))
            if wp.static(in_order):
                if wp.static(length == 8):
                    walk.tmax = box_tmax(walk.found.t)
                else:
                    # Threads that do not go are among others that do not, whose least it is already.
                    walk.tmax = unsortable(min_reduce(sortable(box_tmax(walk.found.t))))
            if wp.static(first_hit_ends):
                hit = group_vote(wp.where(walk.found.prim != NO_PRIM, wp.uint32(1), wp.uint32(0)))
                if own.goes > 0 and hit != wp.uint32(0):
                    walk.top = 1  # the child below ends the traversal
        else:
            own.count = visit(units, begin, lane, limit(walk), stack, walk.top, own.goes > 0)
            sync()
            if wp.static(counters):
                if own.goes > 0:
                    walk.inner_nodes += 1
        if own.goes > 0:
            walk.top = nearest_left(stack, walk.top + own.count - 1, own.count, limit(walk))
            walk.child = child_at(stack, walk.top)
        sync()
        return walk

    @without_gradient
    @wp.func
    def settled(units: wp.uint64, lane: int, stack: stack_argument, walk: walk_type) -> walk_type:
        """The traversal at its end: threads of the ray at its tmax have the closest hit."""
        if wp.static(compares):
            walk.found = keep_nearest(units, stack, lane, walk.found)
            own = wp.where(walk.found.prim == NO_PRIM, wp.inf, box_tmax(walk.found.t))
            walk.tmax = unsortable(min_reduce(sortable(own)))
        if wp.static(keeps_uv):
            walk.found.u = load(stack, U)
            walk.found.v = load(stack, V)
        return walk

    @without_gradient
    @wp.func
    def unscale(stack: stack_argument):
        """t in the frame's units over t of the caller's ray."""
        return load(stack, UNSCALE)

    return SimpleNamespace(
        prepare=prepare,
        keep_for_boxes=keep_for_boxes,
        keep=keep,
        tmin=tmin,
        open=entries.open,
        keep_number=keep_number,
        number_kept=number_kept,
        is_sound=is_sound,
        visit=visit,
        test_leaf=test_leaf,
        count_triangles=count_triangles,
        nearest_left=nearest_left,
        child_at=child_at,
        step=step,
        settled=settled,
        unscale=unscale,
        new_stack=lanes.new_stack,
        stack_argument=stack_argument,
        sync=sync,
    )
