"""Launches over batches of rays, without allocation or synchronisation: CUDA graphs can capture them."""

from __future__ import annotations

from typing import Any, Literal

import warp as wp

from wive.warp_kernels.launching.kernels import any_kernel, closest_kernel
from wive.warp_kernels.tree.quiet import cpu_blocks
from wive.warp_kernels.tree.tree import Tree

Lanes = Literal[1, 8]

SHARED_BYTES = (
    47 * 1024
)  # static shared memory of a block is 48 KiB on every device; the rest is the rays' own


def default_block_dim(lanes: int) -> int:
    """Threads a block. With lanes=1 a block's stacks stand in its shared memory: 64 keep below 48 KiB."""
    return 64 if lanes == 1 else 128


def launch_closest(
    tree: Tree,
    origins: wp.array[Any],
    directions: wp.array[Any],
    tmin: wp.array[Any],
    tmax: wp.array[Any],
    t: wp.array[Any],
    prim: wp.array[Any],
    uv: wp.array[Any] | None = None,
    *,
    stats: wp.array[Any] | None = None,
    lanes: Lanes = 8,
    block_dim: int | None = None,
    stream: wp.Stream | None = None,
) -> None:
    """Write the closest hit of each ray within its closed interval [tmin, tmax].

    Every array lies on `tree.device`; nothing is checked, allocated or synchronised here. For trees of
    float64 vertices read vec3d, vec2d and float64 for vec3, vec2 and float32.

    Args:
        tree: what `upload` returned.
        origins, directions: (n,) vec3. A direction need not have unit length; t counts in multiples of it.
        tmin, tmax: (1,) or (n,) float32.
        t: (n,) float32, infinity where a ray misses.
        prim: (n,) int32, the triangle's row in `faces`, -1 where a ray misses.
        uv: (n,) vec2, NaN where a ray misses; None where nobody asks for it.
        stats: (n,) vec3i, inner nodes, leaves and triangles tested; None runs the kernel without counters.
        lanes: 8, one thread a ray (throughput); 1, eight threads a ray (latency; on Warp's CPU device fibers,
            slow, for tests).
        block_dim: threads a block; a multiple of 8 where lanes is 1. None picks one.
        stream: the CUDA stream to launch on; None is the device's current one.
    """
    kernel = closest_kernel(tree.accuracy, lanes, tree.stack, stats is not None, tree.nodes, tree.precision)
    launch(kernel, tree, [origins, directions, tmin, tmax], [t, prim, uv, stats], lanes, block_dim, stream)


def launch_any(
    tree: Tree,
    origins: wp.array[Any],
    directions: wp.array[Any],
    tmin: wp.array[Any],
    tmax: wp.array[Any],
    occluded: wp.array[Any],
    *,
    stats: wp.array[Any] | None = None,
    lanes: Lanes = 8,
    block_dim: int | None = None,
    stream: wp.Stream | None = None,
) -> None:
    """Write to occluded (n,) bool whether anything lies in each ray's closed interval [tmin, tmax].

    The other arguments are those of `launch_closest`.
    """
    kernel = any_kernel(tree.accuracy, lanes, tree.stack, stats is not None, tree.nodes, tree.precision)
    launch(kernel, tree, [origins, directions, tmin, tmax], [occluded, stats], lanes, block_dim, stream)


def launch(
    kernel: wp.Kernel,
    tree: Tree,
    rays: list[wp.array[Any]],
    outputs: list[wp.array[Any] | None],
    lanes: Lanes,
    block_dim: int | None,
    stream: wp.Stream | None,
) -> None:
    """Launch a kernel over rays: origins, directions, tmin, tmax; a null output is one nobody asked for."""
    count = len(rays[0])
    if count == 0:
        return
    if block_dim is None:
        block_dim = default_block_dim(lanes)
    if lanes == 1 and block_dim % 8 != 0:
        raise ValueError(f"block_dim: expected a multiple of 8 with lanes=1, got {block_dim}")
    if lanes == 1 and tree.device.is_cuda and block_dim // 8 * tree.stack * 8 > SHARED_BYTES:
        raise ValueError(f"block_dim: {block_dim} threads have no room for their stacks in 48 KiB; use fewer")
    with cpu_blocks(lanes == 1 and tree.device.is_cpu):
        wp.launch(
            kernel,
            dim=(count, 8 // lanes),
            inputs=[tree.handle, *rays],
            outputs=outputs,
            device=tree.device,
            stream=stream,
            block_dim=block_dim,
            record_tape=False,
        )
