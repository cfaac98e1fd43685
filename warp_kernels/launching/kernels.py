"""The kernels over batches of rays: one for each query, accuracy, lane form, stack size, counters or
none, node form and precision."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import functools

import warp as wp

from wive.warp_kernels.lanes.lanes import reductions
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import LOAD_FRAME, box_tmax
from wive.warp_kernels.queries.query_exact import distance_of
from wive.warp_kernels.traversal.states import STATES
from wive.warp_kernels.traversal.traversal import make_traversal, query_of
from wive.warp_kernels.tree.handle import ALL_BITS, HANDLES, NO_PRIM

# Multiplications and additions stay apart: fused, the two triangles at an edge would not compute the same
# numbers.
MODULE_OPTIONS = {"fuse_fp": False, "enable_backward": False}


@wp.func
def value_of(values: wp.array(dtype=wp.float32), i: int):
    """The i-th of an array of one value for all rays, or one a ray."""
    return values[wp.where(values.shape[0] == 1, 0, i)]


@wp.func
def value_of(values: wp.array(dtype=wp.float64), i: int):  # noqa: D103, F811
    return values[wp.where(values.shape[0] == 1, 0, i)]


@functools.cache
def closest_kernel(
    accuracy: str,
    length: int,
    stack: int,
    counters: bool = False,
    nodes: str = "float32",
    precision: str = "float32",
) -> wp.Kernel:
    """The kernel behind `launch_closest`, of dimensions (n, 8 // length)."""
    traverse = make_traversal("closest", accuracy, length, stack, counters, nodes, precision)
    load_frame, numbers = LOAD_FRAME[precision], PRECISIONS[precision]
    real, vec2, vec3 = numbers.real, numbers.vec2, numbers.vec3
    state_type = STATES[query_of("closest", accuracy, precision).state]
    or_reduce, min_reduce = reductions(length)
    tree_type = HANDLES[accuracy]

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=MODULE_OPTIONS)
    def closest(
        tree: tree_type,
        origins: wp.array(dtype=vec3),
        directions: wp.array(dtype=vec3),
        tmin: wp.array(dtype=real),
        tmax: wp.array(dtype=real),
        t: wp.array(dtype=real),
        prim: wp.array(dtype=wp.int32),
        uv: wp.array(dtype=vec2),
        stats: wp.array(dtype=wp.vec3i),
    ):
        i, lane = wp.tid()
        ray = load_frame(
            tree.center, tree.extent, origins[i], directions[i], value_of(tmin, i), value_of(tmax, i)
        )
        found = state_type()
        found.best.prim = wp.static(NO_PRIM)
        # One answer for the group, whose threads may see the flag change at different times.
        if ray.valid and or_reduce(wp.uint32(tree.error[0])) == wp.uint32(0):
            found = traverse(tree, ray, lane)
        own = wp.uint32(found.best.prim)
        if box_tmax(found.best.t) != found.tmax:
            own = ALL_BITS
        winner = min_reduce(own)
        if winner == ALL_BITS:
            if lane == 0:
                t[i] = real(wp.inf)
                prim[i] = wp.static(NO_PRIM)
                if uv:
                    uv[i] = vec2(real(wp.nan), real(wp.nan))
        elif own == winner:
            t[i] = distance_of(found.best, ray.scale)
            prim[i] = found.best.prim
            if uv:
                uv[i] = vec2(found.best.u, found.best.v)
        if wp.static(counters):  # noqa: SIM102
            if lane == 0:
                stats[i] = wp.vec3i(found.inner_nodes, found.leaves, found.triangles)

    return closest


@functools.cache
def any_kernel(
    accuracy: str,
    length: int,
    stack: int,
    counters: bool = False,
    nodes: str = "float32",
    precision: str = "float32",
) -> wp.Kernel:
    """The kernel behind `launch_any`, of dimensions (n, 8 // length)."""
    traverse = make_traversal("any", accuracy, length, stack, counters, nodes, precision)
    load_frame, real, vec3 = LOAD_FRAME[precision], PRECISIONS[precision].real, PRECISIONS[precision].vec3
    state_type = STATES[query_of("any", accuracy, precision).state]
    or_reduce, _ = reductions(length)
    tree_type = HANDLES[accuracy]

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=MODULE_OPTIONS)
    def any_in_the_way(
        tree: tree_type,
        origins: wp.array(dtype=vec3),
        directions: wp.array(dtype=vec3),
        tmin: wp.array(dtype=real),
        tmax: wp.array(dtype=real),
        occluded: wp.array(dtype=wp.bool),
        stats: wp.array(dtype=wp.vec3i),
    ):
        i, lane = wp.tid()
        ray = load_frame(
            tree.center, tree.extent, origins[i], directions[i], value_of(tmin, i), value_of(tmax, i)
        )
        found = state_type()
        found.best.prim = wp.static(NO_PRIM)
        if ray.valid and or_reduce(wp.uint32(tree.error[0])) == wp.uint32(0):
            found = traverse(tree, ray, lane)
        hit = or_reduce(wp.where(found.best.prim == wp.static(NO_PRIM), wp.uint32(0), wp.uint32(1)))
        if lane == 0:
            occluded[i] = hit != wp.uint32(0)
            if wp.static(counters):
                stats[i] = wp.vec3i(found.inner_nodes, found.leaves, found.triangles)

    return any_in_the_way
