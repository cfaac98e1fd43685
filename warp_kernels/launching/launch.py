"""Launches over batches of rays, without synchronisation and, `launch_all` and `scan_counts` aside, without
allocation: CUDA graphs can capture them."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from wive.warp_kernels.lanes.warps import Lanes, expected_lanes
from wive.warp_kernels.launching.kernels import make_kernel
from wive.warp_kernels.launching.sorting import shift_counts, sort_kernel
from wive.warp_kernels.tree.handle import LISTED_HITS
from wive.warp_kernels.tree.quiet import cpu_blocks, launch
from wive.warp_kernels.tree.tree import Tree

# Warp arrays hold no more.
MOST_HITS = 2**31 - 1
MOST_THREADS = 1024  # per block, on every CUDA device
# A block has 64 Ki registers on every CUDA device: 128 per thread, or up to 168 in float64 trees.
MOST_CUDA_THREADS = {"float32": 512, "float64": 384}
# Static shared memory of a block is 48 KiB on every CUDA device; 1 KiB is for what triangle tests keep.
SHARED_BYTES = 47 * 1024
# Warps trace several rays per lane, so that lanes whose ray has ended take another, if all that the GPU holds
# have rays then.
RESIDENT_WARPS = 24  # per multiprocessor
MOST_TURNS = 16
# Warp's CPU device runs threads one after another, each of which makes a stack.
CPU_THREADS = 64
MOST_CPU_TURNS = 256


def default_block_dim(lanes: int) -> int:
    """Threads per block: with lanes=1, 64 keep the block's stacks within its 48 KiB of shared memory."""
    return 64 if expected_lanes(lanes) == 1 else 128


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

    Every array is on `tree.device`; the arrays are not checked here. For trees of float64 vertices read
    vec3d, vec2d and float64 for vec3, vec2 and float32.

    Args:
        tree: what `upload` returned.
        origins, directions: (n,) vec3. A direction need not have unit length; t counts in multiples of it.
        tmin, tmax: (1,) or (n,) float32.
        t: (n,) float32, infinity on a miss.
        prim: (n,) int32, the triangle's row in `faces`, -1 on a miss.
        uv: (n,) vec2, NaN on a miss; None if not wanted.
        stats: (n,) vec3i, inner nodes, leaves and triangles tested; None runs the kernel without counters.
        lanes: 8, one thread per ray (throughput); 1, eight threads per ray (latency; on Warp's CPU device
            fibers, slow, for tests).
        block_dim: threads per block, up to 1024; with lanes=1 a multiple of 8. None picks one.
        stream: the CUDA stream to launch on; None is the device's current one.

    Raises:
        ValueError: lanes or block_dim out of range.
    """
    rays, outputs = (origins, directions, tmin, tmax), (t, prim, uv)
    _launch("closest", tree, rays, (*outputs, stats), lanes, block_dim, stream, counters=stats is not None)


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
    """Write to occluded (n,) bool whether each ray hits anything in its closed interval [tmin, tmax].

    The other arguments are those of `launch_closest`.
    """
    rays = (origins, directions, tmin, tmax)
    _launch("any", tree, rays, (occluded, stats), lanes, block_dim, stream, counters=stats is not None)


def launch_count(
    tree: Tree,
    origins: wp.array[Any],
    directions: wp.array[Any],
    tmin: wp.array[Any],
    tmax: wp.array[Any],
    counts: wp.array[Any],
    *,
    stats: wp.array[Any] | None = None,
    touching: bool = False,
    lanes: Lanes = 8,
    block_dim: int | None = None,
    stream: wp.Stream | None = None,
) -> None:
    """Write to counts (n,) int32 how many hits each ray has in its closed interval [tmin, tmax].

    touching: count every triangle that the ray touches; otherwise a ray through an edge or a vertex of a
    closed surface crosses it once. The other arguments are those of `launch_closest`.
    """
    rays = (origins, directions, tmin, tmax)
    _launch(
        "count_touching" if touching else "count",
        tree,
        rays,
        (counts, stats),
        lanes,
        block_dim,
        stream,
        counters=stats is not None,
    )


def scan_counts(counts: wp.array[Any]) -> wp.array[Any]:
    """Offsets (n+1,) int64: where the hits of each ray begin, and where the last ray's end.

    They are allocated here, and computed on the device's current stream.
    """
    shifted = wp.empty(len(counts) + 1, dtype=wp.int64, device=counts.device)
    offsets = wp.empty_like(shifted)
    launch(shift_counts, len(shifted), [counts], [shifted], device=counts.device, record_tape=False)
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
    touching: bool = False,
    lanes: Lanes = 8,
    block_dim: int | None = None,
    stream: wp.Stream | None = None,
) -> None:
    """Write the hits that `launch_count` counted, each ray's by ascending t, then prim.

    Args:
        tree, origins, directions, tmin, tmax, touching, lanes, block_dim, stream: as for `launch_count`.
        counts: (n,) int32 of `launch_count`; they run down to zero.
        offsets: (n+1,) int64 of `scan_counts`.
        t: (h,) float32, h the last of the offsets, at most 2^31 - 1.
        prim: (h,) int32.
        uv: (h,) vec2. In float64 trees t is float64 and uv vec2d.
    """
    block_dim = _expected_block_dim(tree, expected_lanes(lanes), block_dim)
    query = "all_touching" if touching else "all"
    rays = (origins, directions, tmin, tmax)
    # Hits are allocated and freed on the stream that writes them.
    with wp.ScopedStream(stream, sync_enter=False):
        _list_and_sort(query, tree, rays, (counts, offsets), (t, prim, uv), lanes, block_dim)


def _list_and_sort(
    query: str,
    tree: Tree,
    rays: tuple[wp.array[Any], ...],
    places: tuple[wp.array[Any], ...],
    outputs: tuple[wp.array[Any], ...],
    lanes: Lanes,
    block_dim: int | None,
) -> None:
    """List hits at the places given by counts and offsets, in any order, then sort them into the outputs."""
    counts, offsets = places
    hits = wp.empty(len(outputs[0]), dtype=LISTED_HITS[tree.precision], device=tree.device)
    _launch(query, tree, rays, (offsets, counts, hits), lanes, block_dim, None)
    sort = sort_kernel(tree.precision)
    launch(sort, len(counts), [offsets, counts, hits], list(outputs), device=tree.device, record_tape=False)


def _launch(
    query: str,
    tree: Tree,
    rays: tuple[wp.array[Any], ...],
    outputs: tuple[wp.array[Any] | None, ...],
    lanes: Lanes,
    block_dim: int | None,
    stream: wp.Stream | None,
    *,
    counters: bool = False,
) -> None:
    """Launch a query's kernel over rays: origins, directions, tmin, tmax; outputs not wanted are None."""
    lanes = expected_lanes(lanes)
    block_dim = _expected_block_dim(tree, lanes, block_dim)
    if len(rays[0]) == 0:
        return
    in_warps = loops_in_warps(tree.device, lanes)
    kernel = make_kernel(
        query, tree.accuracy, lanes, tree.stack, counters, tree.nodes, tree.precision, in_warps
    )
    turns = turns_of(tree.device, len(rays[0]))
    with cpu_blocks(lanes == 1 and tree.device.is_cpu):
        launch(
            kernel,
            threads_of(len(rays[0]), turns, lanes, block_dim),
            [tree.batch_handle, *rays, turns],
            list(outputs),
            device=tree.device,
            stream=stream,
            block_dim=block_dim,
            record_tape=False,
        )


def loops_in_warps(device: wp.Device, lanes: Lanes) -> bool:
    """Whether threads of a launch loop together: those of a warp on CUDA, or the fibers of a ray."""
    return device.is_cuda or lanes == 1


def turns_of(device: wp.Device, count: int) -> int:
    """How many rays there are per lane, of so many: all threads that the device holds at once have some."""
    threads = 32 * RESIDENT_WARPS * device.sm_count if device.is_cuda else CPU_THREADS
    most = MOST_TURNS if device.is_cuda else MOST_CPU_TURNS
    return max(1, min(most, count // threads))


def threads_of(count: int, turns: int, lanes: Lanes, block_dim: int) -> int:
    """Threads of a launch over so many rays: whole blocks, whose warps share the rays out."""
    threads = 8 // lanes * -(-count // turns)
    return block_dim * -(-threads // block_dim)


def _expected_block_dim(tree: Tree, lanes: Lanes, block_dim: int | None) -> int:
    """The threads per block; ValueError if they are no number that the kernel can be launched with."""
    if block_dim is None:
        return default_block_dim(lanes)
    if isinstance(block_dim, bool) or not isinstance(block_dim, (int, np.integer)):
        raise ValueError(f"block_dim: expected 1 to {MOST_THREADS} threads, got {block_dim!r}")
    if not 0 < block_dim <= MOST_THREADS:
        raise ValueError(f"block_dim: expected 1 to {MOST_THREADS} threads, got {block_dim}")
    if lanes == 1 and block_dim % 8 != 0:
        raise ValueError(f"block_dim: expected a multiple of 8 with lanes=1, got {block_dim}")
    if tree.device.is_cuda:
        if block_dim > MOST_CUDA_THREADS[tree.precision]:
            raise ValueError(
                f"block_dim: {block_dim} threads have no room in a block's registers; "
                f"use at most {MOST_CUDA_THREADS[tree.precision]} in a {tree.precision} tree"
            )
        if lanes == 1 and block_dim // 8 * tree.stack * 8 > SHARED_BYTES:
            raise ValueError(
                f"block_dim: {block_dim} threads have no room for their stacks in 48 KiB; use fewer"
            )
    return int(block_dim)
