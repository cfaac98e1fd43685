"""Launches for everything along a ray: counts, where each ray's hits begin, and the hits, sorted."""

from __future__ import annotations

from typing import Any

import warp as wp

from wive.warp_kernels.launching.kernels_all import all_kernel, count_kernel
from wive.warp_kernels.launching.launch import Lanes, launch
from wive.warp_kernels.launching.sorting import shift_counts, sort_kernel
from wive.warp_kernels.tree.handle import HITS
from wive.warp_kernels.tree.tree import Tree

# What one Warp array can hold.
MOST_HITS = 2**31 - 1


def launch_count(
    tree: Tree,
    origins: wp.array[Any],
    directions: wp.array[Any],
    tmin: wp.array[Any],
    tmax: wp.array[Any],
    counts: wp.array[Any],
    *,
    stats: wp.array[Any] | None = None,
    lanes: Lanes = 8,
    block_dim: int | None = None,
    stream: wp.Stream | None = None,
) -> None:
    """Write to counts (n,) int32 how many triangles each ray meets in its closed interval [tmin, tmax].

    The other arguments are those of `launch_closest`.
    """
    kernel = count_kernel(tree.accuracy, lanes, tree.stack, stats is not None, tree.nodes, tree.precision)
    launch(kernel, tree, [origins, directions, tmin, tmax], [counts, stats], lanes, block_dim, stream)


def scan_counts(counts: wp.array[Any]) -> wp.array[Any]:
    """(n+1,) int64 offsets: where the hits of each ray begin, and where the last one's end.

    They are allocated here, and computed on the device's current stream.
    """
    shifted = wp.empty(len(counts) + 1, dtype=wp.int64, device=counts.device)
    offsets = wp.empty_like(shifted)
    wp.launch(shift_counts, len(shifted), [counts], [shifted], device=counts.device, record_tape=False)
    wp.utils.array_scan(shifted, offsets, inclusive=True)
    return offsets


def launch_all(
    tree: Tree,
    origins: wp.array[Any],
    directions: wp.array[Any],
    tmin: wp.array[Any],
    tmax: wp.array[Any],
    counts: wp.array[Any],
    offsets: wp.array[Any],
    t: wp.array[Any],
    prim: wp.array[Any],
    uv: wp.array[Any],
    *,
    lanes: Lanes = 8,
    block_dim: int | None = None,
    stream: wp.Stream | None = None,
) -> None:
    """Write the hits that `launch_count` counted, each ray's by ascending t, then prim.

    Args:
        tree, origins, directions, tmin, tmax, lanes, block_dim, stream: as for `launch_count`.
        counts: (n,) int32 of `launch_count`; they run down to zero.
        offsets: (n+1,) int64 of `scan_counts`.
        t: (h,) float32, h the last of the offsets, at most 2^31 - 1.
        prim: (h,) int32.
        uv: (h,) vec2. In float64 trees t is float64 and uv vec2d.
    """
    hits = wp.empty(len(t), dtype=HITS[tree.precision], device=tree.device)
    kernel = all_kernel(tree.accuracy, lanes, tree.stack, tree.nodes, tree.precision)
    launch(kernel, tree, [origins, directions, tmin, tmax], [offsets, counts, hits], lanes, block_dim, stream)
    wp.launch(
        sort_kernel(tree.precision),
        len(counts),
        [offsets, counts, hits],
        [t, prim, uv],
        device=tree.device,
        stream=stream,
        record_tape=False,
    )
