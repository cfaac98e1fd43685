"""The kernels over batches of rays.

One kernel per query, accuracy, lane form, stack size, node form and precision, with and without counters.
"""

import functools

import warp as wp

from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.launching.batches import make_loop
from wive.warp_kernels.launching.outputs import OUTPUTS, RAYS
from wive.warp_kernels.tree.handle import HANDLES, LISTED_HITS

# Multiplications and additions stay apart: fused, the two triangles at an edge would not compute the same
# numbers.
MODULE_OPTIONS = {"fuse_fp": False, "enable_backward": False}

# Registers per thread, by accuracy and lane form: more would leave room for fewer warps, fewer would make
# kernels spill. Kernels of exact and of float64 trees, and those with counters, take what they need.
MOST_REGISTERS = {("fast", 8): 80, ("fast", 1): 64, ("watertight", 8): 88, ("watertight", 1): 72}
# The closest hit of watertight trees with float32 nodes, lanes=8: others would spill on sm_100.
CLOSEST_REGISTERS = 80


@functools.cache
def make_kernel(
    query: str,
    accuracy: str,
    length: int,
    stack_size: int,
    counters: bool = False,
    nodes: str = "float32",
    precision: str = "float32",
    in_warps: bool = True,
) -> wp.Kernel:
    """The kernel of a query in QUERIES, to be launched with 8 // length threads per ray and turn.

    Its arguments are the tree's handle, origins, directions, tmin, tmax, turns and the outputs of that query.
    """
    trace_share = make_loop(query, accuracy, length, stack_size, counters, nodes, precision, in_warps)
    numbers = PRECISIONS[precision]
    vec2 = numbers.vec2
    tree, vectors, reals = (
        HANDLES[accuracy, precision],
        wp.array(dtype=numbers.vec3),
        wp.array(dtype=numbers.real),
    )
    rays_type, outputs_type, hit_type = RAYS[precision], OUTPUTS[precision], LISTED_HITS[precision]

    usual = precision == "float32" and not counters
    most_registers = MOST_REGISTERS.get((accuracy, length)) if usual else None
    if usual and (query, accuracy, length, nodes) == ("closest", "watertight", 8, "float32"):
        most_registers = CLOSEST_REGISTERS
    ray_kernel = wp.kernel(
        module="unique",
        enable_backward=False,
        grid_stride=False,
        module_options=MODULE_OPTIONS,
        cuda_max_registers=most_registers,
    )

    @wp.func
    def rays_of(origins: vectors, directions: vectors, tmin: reals, tmax: reals) -> rays_type:
        rays = rays_type()
        rays.origins = origins
        rays.directions = directions
        rays.tmin = tmin
        rays.tmax = tmax
        return rays

    @ray_kernel
    def closest(
        tree: tree,
        origins: vectors,
        directions: vectors,
        tmin: reals,
        tmax: reals,
        turns: int,
        t: reals,
        prim: wp.array(dtype=wp.int32),
        uv: wp.array(dtype=vec2),
        stats: wp.array(dtype=wp.vec3i),
    ):
        out = outputs_type()
        out.t = t
        out.prim = prim
        out.uv = uv
        out.stats = stats
        trace_share(tree, rays_of(origins, directions, tmin, tmax), out, wp.tid(), turns)

    @ray_kernel
    def any_in_the_way(
        tree: tree,
        origins: vectors,
        directions: vectors,
        tmin: reals,
        tmax: reals,
        turns: int,
        occluded: wp.array(dtype=wp.bool),
        stats: wp.array(dtype=wp.vec3i),
    ):
        out = outputs_type()
        out.occluded = occluded
        out.stats = stats
        trace_share(tree, rays_of(origins, directions, tmin, tmax), out, wp.tid(), turns)

    @ray_kernel
    def count_along(
        tree: tree,
        origins: vectors,
        directions: vectors,
        tmin: reals,
        tmax: reals,
        turns: int,
        counts: wp.array(dtype=wp.int32),
        stats: wp.array(dtype=wp.vec3i),
    ):
        out = outputs_type()
        out.counts = counts
        out.stats = stats
        trace_share(tree, rays_of(origins, directions, tmin, tmax), out, wp.tid(), turns)

    @ray_kernel
    def list_along(
        tree: tree,
        origins: vectors,
        directions: vectors,
        tmin: reals,
        tmax: reals,
        turns: int,
        offsets: wp.array(dtype=wp.int64),
        remaining: wp.array(dtype=wp.int32),
        hits: wp.array(dtype=hit_type),
    ):
        out = outputs_type()
        out.offsets = offsets
        out.remaining = remaining
        out.hits = hits
        trace_share(tree, rays_of(origins, directions, tmin, tmax), out, wp.tid(), turns)

    kernels = {"closest": closest, "any": any_in_the_way, "all": list_along, "all_touching": list_along}
    return kernels.get(query, count_along)
