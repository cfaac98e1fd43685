"""The kernel of closest points over batches, and its launch."""

import functools
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.launching.kernels import MODULE_OPTIONS
from wive.warp_kernels.launching.launch import default_block_dim
from wive.warp_kernels.traversal.closest_point import Located, make_closest_point
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES
from wive.warp_kernels.tree.quiet import launch
from wive.warp_kernels.tree.tree import Tree


@wp.func
def value_of(values: wp.array(dtype=wp.float32), i: int):
    """The i-th of one value per point, or the one value for all points."""
    return values[wp.where(values.shape[0] == 1, 0, i)]


@wp.func
def value_of(values: wp.array(dtype=wp.float64), i: int):
    return values[wp.where(values.shape[0] == 1, 0, i)]


@functools.cache
def make_closest_kernel(accuracy: str, stack_size: int, nodes: str, precision: str) -> wp.Kernel:
    """The kernel, to be launched with dim (n,)."""
    numbers, tree_type = PRECISIONS[precision], HANDLES[accuracy, precision]
    real, vec2, vec3 = numbers.real, numbers.vec2, numbers.vec3
    search = make_closest_point(accuracy, stack_size, nodes, precision)

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=MODULE_OPTIONS)
    def closest_points(
        tree: tree_type,
        points: wp.array(dtype=vec3),
        max_distance: wp.array(dtype=real),
        distance: wp.array(dtype=real),
        prim: wp.array(dtype=wp.int32),
        uv: wp.array(dtype=vec2),
    ):
        i = wp.tid()
        found = Located()
        found.distance = wp.float64(wp.inf)
        found.u = wp.float64(wp.nan)
        found.v = wp.float64(wp.nan)
        found.prim = -1
        if tree.error[CORRUPTION] == 0:
            found = search(tree, points[i], value_of(max_distance, i))
        distance[i] = real(found.distance)
        prim[i] = found.prim
        uv[i] = vec2(real(found.u), real(found.v))

    return closest_points


def launch_closest_points(
    tree: Tree,
    points: wp.array[Any],
    max_distance: wp.array[Any],
    distance: wp.array[Any],
    prim: wp.array[Any],
    uv: wp.array[Any],
    *,
    block_dim: int | None = None,
    stream: wp.Stream | None = None,
) -> None:
    """Write the surface's closest point to each point, within its largest distance.

    Every array is on `tree.device`; the arrays are not checked here. For trees of float64 vertices read
    vec3d, vec2d and float64 for vec3, vec2 and float32.

    Args:
        tree: what `upload` returned.
        points: (n,) vec3.
        max_distance: (1,) or (n,) float32; nothing is close enough if it is negative or NaN.
        distance: (n,) float32, infinity if nothing is close enough.
        prim: (n,) int32, the triangle's row in `faces`, else -1.
        uv: (n,) vec2, else NaN.
        block_dim: threads per block; None picks a number.
        stream: the CUDA stream to launch on; None is the device's current one.
    """
    if len(points) == 0:
        return
    launch(
        make_closest_kernel(tree.accuracy, tree.stack, tree.nodes, tree.precision),
        len(points),
        [tree.batch_handle, points, max_distance],
        [distance, prim, uv],
        device=tree.device,
        stream=stream,
        block_dim=default_block_dim(8) if block_dim is None else block_dim,
        record_tape=False,
    )
