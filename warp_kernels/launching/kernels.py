"""The kernels over batches of rays.

One kernel per query, accuracy, lane form, stack size, node form and precision, with and without counters.
"""

import functools
from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import collectives
from wive.warp_kernels.lanes.layout import ALL_BITS, NO_PRIM
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import FRAMES, box_tmax, make_load_frame
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.states import TRAVERSALS
from wive.warp_kernels.traversal.traversal import make_traversal
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES, LISTED_HITS

# Multiplications and additions stay apart: fused, the two triangles at an edge would not compute the same
# numbers.
MODULE_OPTIONS = {"fuse_fp": False, "enable_backward": False}

ray_kernel = wp.kernel(
    module="unique", enable_backward=False, grid_stride=False, module_options=MODULE_OPTIONS
)


@wp.func
def value_of(values: wp.array(dtype=wp.float32), i: int):
    """The i-th of one value per ray, or the one value for all rays."""
    return values[wp.where(values.shape[0] == 1, 0, i)]


@wp.func
def value_of(values: wp.array(dtype=wp.float64), i: int):
    return values[wp.where(values.shape[0] == 1, 0, i)]


@wp.func_native("return (wp::uint64)(remaining.data + i);")
def address_of_count(remaining: wp.array(dtype=wp.int32), i: int) -> wp.uint64:
    """Address of the ray's remaining-hit counter."""
    ...


@functools.cache
def make_kernel(
    query: str,
    accuracy: str,
    length: int,
    stack_size: int,
    counters: bool = False,
    nodes: str = "float32",
    precision: str = "float32",
) -> wp.Kernel:
    """The kernel of a query in QUERIES, to be launched with dim (n, 8 // length).

    Its arguments are the tree's handle, origins, directions, tmin, tmax and the outputs of that query.
    """
    numbers, query_type = PRECISIONS[precision], query_of(query, accuracy, precision)
    real, vec3 = numbers.real, numbers.vec3
    tree_type, frame_type = HANDLES[accuracy, precision], FRAMES[precision]
    found_type, result_type = query_type.state, TRAVERSALS[query_type.state]
    traverse = make_traversal(query, accuracy, length, stack_size, counters, nodes, precision)
    or_reduce = collectives(length).or_reduce
    load_frame = make_load_frame(accuracy, precision)

    @wp.func
    def load_ray(
        tree: tree_type,
        origins: wp.array(dtype=vec3),
        directions: wp.array(dtype=vec3),
        tmin: wp.array(dtype=real),
        tmax: wp.array(dtype=real),
        i: int,
    ) -> frame_type:
        return load_frame(tree.center, origins[i], directions[i], value_of(tmin, i), value_of(tmax, i))

    @wp.func
    def trace(tree: tree_type, ray: frame_type, lane: int, found: found_type) -> result_type:
        """The traversal's result; nothing is found if the ray is invalid or the error flag is set."""
        result = result_type()
        result.found = found
        # One answer for the ray's threads, which may see the flag change at different times.
        if ray.valid and or_reduce(wp.uint32(tree.error[CORRUPTION])) == wp.uint32(0):
            result = traverse(tree, ray, lane, found)
        return result

    parts = SimpleNamespace(
        tree=tree_type,
        vectors=wp.array(dtype=vec3),
        numbers=wp.array(dtype=real),
        load_ray=load_ray,
        trace=trace,
        begin=query_type.begin,
    )
    if query == "closest":
        return _closest_kernel(parts, numbers, query_type.distance, length, counters)
    if query in ("all", "all_touching"):
        return _all_kernel(parts, LISTED_HITS[precision])
    return (_any_kernel if query == "any" else _count_kernel)(parts, length, counters)


def _closest_kernel(
    parts: SimpleNamespace, numbers: SimpleNamespace, distance: wp.Function, length: int, counters: bool
) -> wp.Kernel:
    load_ray, trace, begin = parts.load_ray, parts.trace, parts.begin
    real, vec2 = numbers.real, numbers.vec2
    min_reduce = collectives(length).min_reduce

    @ray_kernel
    def closest(
        tree: parts.tree,
        origins: parts.vectors,
        directions: parts.vectors,
        tmin: parts.numbers,
        tmax: parts.numbers,
        t: parts.numbers,
        prim: wp.array(dtype=wp.int32),
        uv: wp.array(dtype=vec2),
        stats: wp.array(dtype=wp.vec3i),
    ):
        i, lane = wp.tid()
        ray = load_ray(tree, origins, directions, tmin, tmax, i)
        result = trace(tree, ray, lane, begin(ray))
        own = wp.uint32(result.found.prim)
        if box_tmax(result.found.t) != result.tmax:
            own = ALL_BITS
        winner = min_reduce(own)
        if winner == ALL_BITS:
            if lane == 0:
                t[i] = real(wp.inf)
                prim[i] = NO_PRIM
                if uv:
                    uv[i] = vec2(real(wp.nan), real(wp.nan))
        elif own == winner:
            t[i] = distance(result.found, ray.unscale)
            prim[i] = result.found.prim
            if uv:
                uv[i] = vec2(result.found.u, result.found.v)
        if wp.static(counters):
            if lane == 0:
                stats[i] = wp.vec3i(result.inner_nodes, result.leaves, result.triangles)

    return closest


def _any_kernel(parts: SimpleNamespace, length: int, counters: bool) -> wp.Kernel:
    load_ray, trace, begin = parts.load_ray, parts.trace, parts.begin
    or_reduce = collectives(length).or_reduce

    @ray_kernel
    def any_in_the_way(
        tree: parts.tree,
        origins: parts.vectors,
        directions: parts.vectors,
        tmin: parts.numbers,
        tmax: parts.numbers,
        occluded: wp.array(dtype=wp.bool),
        stats: wp.array(dtype=wp.vec3i),
    ):
        i, lane = wp.tid()
        ray = load_ray(tree, origins, directions, tmin, tmax, i)
        result = trace(tree, ray, lane, begin(ray))
        hit = or_reduce(wp.where(result.found.prim == NO_PRIM, wp.uint32(0), wp.uint32(1)))
        if lane == 0:
            occluded[i] = hit != wp.uint32(0)
            if wp.static(counters):
                stats[i] = wp.vec3i(result.inner_nodes, result.leaves, result.triangles)

    return any_in_the_way


def _count_kernel(parts: SimpleNamespace, length: int, counters: bool) -> wp.Kernel:
    load_ray, trace, begin = parts.load_ray, parts.trace, parts.begin
    sum_reduce = collectives(length).sum_reduce

    @ray_kernel
    def count_along(
        tree: parts.tree,
        origins: parts.vectors,
        directions: parts.vectors,
        tmin: parts.numbers,
        tmax: parts.numbers,
        counts: wp.array(dtype=wp.int32),
        stats: wp.array(dtype=wp.vec3i),
    ):
        i, lane = wp.tid()
        ray = load_ray(tree, origins, directions, tmin, tmax, i)
        result = trace(tree, ray, lane, begin(ray))
        count = sum_reduce(wp.uint32(result.found.count))
        if lane == 0:
            counts[i] = wp.int32(count)
            if wp.static(counters):
                stats[i] = wp.vec3i(result.inner_nodes, result.leaves, result.triangles)

    return count_along


def _all_kernel(parts: SimpleNamespace, hit_type: type) -> wp.Kernel:
    load_ray, trace, begin = parts.load_ray, parts.trace, parts.begin

    @wp.func_native("return (wp::uint64)(hits.data + first);")
    def address_of_hit(hits: wp.array(dtype=hit_type), first: wp.int64) -> wp.uint64:
        """Address of the ray's first hit."""
        ...

    @ray_kernel
    def list_along(
        tree: parts.tree,
        origins: parts.vectors,
        directions: parts.vectors,
        tmin: parts.numbers,
        tmax: parts.numbers,
        offsets: wp.array(dtype=wp.int64),
        remaining: wp.array(dtype=wp.int32),
        hits: wp.array(dtype=hit_type),
    ):
        i, lane = wp.tid()
        first = offsets[i]
        # A ray whose count is zero is not traced again; all its threads return here.
        if offsets[i + 1] == first:
            return
        ray = load_ray(tree, origins, directions, tmin, tmax, i)
        found = begin(ray)
        found.unscale = ray.unscale
        found.hits = address_of_hit(hits, first)
        found.remaining = address_of_count(remaining, i)
        trace(tree, ray, lane, found)

    return list_along
