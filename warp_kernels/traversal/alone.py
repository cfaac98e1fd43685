"""The whole traversal of a ray by one thread alone, as `walk` in cpu/traverse/traversal.h."""

import functools

import warp as wp

from wive.warp_kernels.lanes.lanes import address_of, without_gradient
from wive.warp_kernels.lanes.layout import END_OF_STACK, NO_PRIM, WORD_MASK
from wive.warp_kernels.queries.frame import FRAMES, box_tmax
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.states import TRAVERSALS
from wive.warp_kernels.traversal.traversal import make_steps
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES


@functools.cache
def make_traverse(
    query: str,
    accuracy: str,
    stack_size: int,
    counters: bool,
    nodes: str,
    precision: str,
    prepares_late: bool,
) -> wp.Function:
    """traverse(tree, units, stack, ray, found, enters): from the state `found`; returns one of TRAVERSALS.

    units: the tree's address. stack: opened before. enters: false for a ray that is known to miss the tree.
    prepares_late: what leaves need of a ray is computed at its first one. That is less work for rays that
    meet none, but on CUDA the ray stays in registers.
    """
    steps = make_steps(query, accuracy, 8, stack_size, counters, nodes, precision)
    prepare, keep_for_boxes, tmin = steps.prepare, steps.keep_for_boxes, steps.tmin
    is_sound, visit, test_leaf, count_triangles = (
        steps.is_sound, steps.visit, steps.test_leaf, steps.count_triangles,
    )  # fmt: skip
    nearest_left, child_at, stack_argument = steps.nearest_left, steps.child_at, steps.stack_argument
    query_type = query_of(query, accuracy, precision)
    in_order: bool = query_type.in_order
    first_hit_ends: bool = query_type.first_hit_ends
    tree_type, frame_type, found_type = HANDLES[accuracy, precision], FRAMES[precision], query_type.state
    walk_type = TRAVERSALS[found_type]

    @without_gradient
    @wp.func
    def traverse(
        tree: tree_type,
        units: wp.uint64,
        stack: stack_argument,
        ray: frame_type,
        found: found_type,
        enters: bool,
    ) -> walk_type:
        walk = walk_type()
        walk.found = found
        # Variables, not fields of the struct, which the compiler of Warp's CPU device would keep in memory.
        tmax = box_tmax(ray.tmax)
        top = int(1)
        child = int(END_OF_STACK)
        steps = int(0)
        prepared = bool(False)
        if enters:
            keep_for_boxes(ray, stack)
            if wp.static(not prepares_late):
                prepare(ray, stack)
            child = int(0)
        while child != END_OF_STACK:
            begin = child & WORD_MASK
            count = int(0)
            steps += 1
            if not is_sound(tree, steps, top, begin):
                tree.error[CORRUPTION] = 1
                break
            if child >= 0:
                count = visit(units, begin, 0, tmax, stack, top, True)
                if wp.static(counters):
                    walk.inner_nodes += 1
            else:
                if wp.static(prepares_late):
                    if not prepared:
                        prepare(ray, stack)
                        prepared = bool(True)
                block_count = (child & 7) + 1
                leaf = test_leaf(units, begin, block_count, 0, stack, tmin(stack), walk.found)
                walk.found = leaf.found
                if wp.static(counters):
                    walk.leaves += 1
                    walk.triangles += count_triangles(units, begin, wp.min(block_count, leaf.last + 1))
                if wp.static(in_order):
                    tmax = box_tmax(walk.found.t)
                if wp.static(first_hit_ends):
                    if walk.found.prim != NO_PRIM:
                        top = int(1)  # the child below ends the traversal
            top = nearest_left(stack, top + count - 1, count, tmax)
            child = child_at(stack, top)
        walk.tmax = tmax
        return walk

    return traverse


@functools.cache
def make_traversal(query: str, accuracy: str, stack_size: int, precision: str) -> wp.Function:
    """The traversal for users' kernels, with a stack of its own.

    traverse(tree, ray, found) continues from the state `found` and returns one of TRAVERSALS.
    """
    steps = make_steps(query, accuracy, 8, stack_size, False, "float32", precision)
    open_stack, new_stack = steps.open, steps.new_stack
    traverse_with = make_traverse(query, accuracy, stack_size, False, "float32", precision, False)
    tree_type, found_type = HANDLES[accuracy, precision], query_of(query, accuracy, precision).state
    frame_type, walk_type = FRAMES[precision], TRAVERSALS[found_type]

    @without_gradient
    @wp.func
    def traverse(tree: tree_type, ray: frame_type, found: found_type) -> walk_type:
        stack = new_stack()
        open_stack(stack)
        return traverse_with(tree, address_of(tree.units), stack, ray, found, True)

    return traverse
