"""The kernels for everything along a ray: one that counts, one that lists what was counted."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import functools

import warp as wp

from wive.warp_kernels.lanes.lanes import reductions, sum_reduction
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.launching.kernels import MODULE_OPTIONS, value_of
from wive.warp_kernels.queries.frame import LOAD_FRAME
from wive.warp_kernels.queries.query_all import begin_crossings
from wive.warp_kernels.traversal.states import STATES
from wive.warp_kernels.traversal.traversal import make_traversal, make_traversal_from, query_of
from wive.warp_kernels.tree.handle import HANDLES, HITS


@wp.func_native("return (wp::uint64)(left.data + i);")
def address_of_number(left: wp.array(dtype=wp.int32), i: int) -> wp.uint64:
    """Where the number of a ray's hits that are still to come stands."""
    ...


@functools.cache
def count_kernel(
    accuracy: str,
    length: int,
    stack: int,
    counters: bool = False,
    nodes: str = "float32",
    precision: str = "float32",
) -> wp.Kernel:
    """The kernel behind `launch_count`, of dimensions (n, 8 // length)."""
    traverse = make_traversal("count", accuracy, length, stack, counters, nodes, precision)
    load_frame, real, vec3 = LOAD_FRAME[precision], PRECISIONS[precision].real, PRECISIONS[precision].vec3
    state_type = STATES[query_of("count", accuracy, precision).state]
    or_reduce, _ = reductions(length)
    add_reduce = sum_reduction(length)
    tree_type = HANDLES[accuracy]

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=MODULE_OPTIONS)
    def count_along(
        tree: tree_type,
        origins: wp.array(dtype=vec3),
        directions: wp.array(dtype=vec3),
        tmin: wp.array(dtype=real),
        tmax: wp.array(dtype=real),
        counts: wp.array(dtype=wp.int32),
        stats: wp.array(dtype=wp.vec3i),
    ):
        i, lane = wp.tid()
        ray = load_frame(
            tree.center, tree.extent, origins[i], directions[i], value_of(tmin, i), value_of(tmax, i)
        )
        found = state_type()
        if ray.valid and or_reduce(wp.uint32(tree.error[0])) == wp.uint32(0):
            found = traverse(tree, ray, lane)
        count = add_reduce(wp.uint32(found.best.count))
        if lane == 0:
            counts[i] = wp.int32(count)
            if wp.static(counters):
                stats[i] = wp.vec3i(found.inner_nodes, found.leaves, found.triangles)

    return count_along


@functools.cache
def all_kernel(
    accuracy: str, length: int, stack: int, nodes: str = "float32", precision: str = "float32"
) -> wp.Kernel:
    """The kernel that lists the hits behind `launch_all`, of dimensions (n, 8 // length)."""
    traverse_from = make_traversal_from("all", accuracy, length, stack, False, nodes, precision)
    load_frame, real, vec3 = LOAD_FRAME[precision], PRECISIONS[precision].real, PRECISIONS[precision].vec3
    or_reduce, _ = reductions(length)
    tree_type, hit_type = HANDLES[accuracy], HITS[precision]

    @wp.func_native("return (wp::uint64)(hits.data + first);")
    def address_of_hit(hits: wp.array(dtype=hit_type), first: wp.int64) -> wp.uint64:
        """Where a ray's hits begin."""
        ...

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=MODULE_OPTIONS)
    def list_along(
        tree: tree_type,
        origins: wp.array(dtype=vec3),
        directions: wp.array(dtype=vec3),
        tmin: wp.array(dtype=real),
        tmax: wp.array(dtype=real),
        offsets: wp.array(dtype=wp.int64),
        left: wp.array(dtype=wp.int32),
        hits: wp.array(dtype=hit_type),
    ):
        i, lane = wp.tid()
        first = offsets[i]
        # A ray for which the first pass found nothing is not asked again; the answer is one for the group.
        if offsets[i + 1] == first:
            return
        ray = load_frame(
            tree.center, tree.extent, origins[i], directions[i], value_of(tmin, i), value_of(tmax, i)
        )
        if ray.valid and or_reduce(wp.uint32(tree.error[0])) == wp.uint32(0):
            found = begin_crossings(ray)
            found.scale = ray.scale
            found.hits = address_of_hit(hits, first)
            found.left = address_of_number(left, i)
            traverse_from(tree, ray, lane, found)

    return list_along
