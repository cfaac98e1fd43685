"""Threads that work together: those of a ray, which share its node's lanes, and those of a warp.

Native code: intrinsics on CUDA, barriers between fibers on Warp's CPU device. Names that end in 8 are for
lanes=8, one thread per ray; those in 1 for lanes=1, eight threads per ray.
"""

import functools
from types import SimpleNamespace
from typing import Literal

import numpy as np
import warp as wp

Lanes = Literal[1, 8]

# The threads that loop together are called a warp: on CUDA those of one, which reach every vote, shuffle and
# barrier together, so that all masks are full; on the CPU device the thread of a ray, or its eight fibers.
_WARP = "const unsigned all = 0xffffffffu;"

# Every fiber of the group writes its value, reads the others' after a barrier, and passes a second barrier
# before the next write.
_EXCHANGE = """
    static unsigned values[WP_TILE_BLOCK_DIM];
    const int thread = WP_TILE_THREAD_IDX, first = thread & ~7;
    values[thread] = x;
    WP_TILE_SYNC();
    RESULT
    WP_TILE_SYNC();
"""


def _of_group(cuda: str, host: str) -> str:
    """Native code of a collective over the unsigned x of a ray's eight threads."""
    return f"""
#if defined(__CUDA_ARCH__)
    {_WARP}
    {cuda}
#else
    {_EXCHANGE.replace("RESULT", host)}
    return result;
#endif
"""


def _reduce(combine: str) -> str:
    """Native code that combines the x and y of a group's threads."""
    return _of_group(
        f"""
    for (int step = 4; step; step >>= 1) {{
        const unsigned y = __shfl_xor_sync(all, x, step);
        x = {combine};
    }}
    return x;
""",
        f"""
    unsigned result = values[first];
    for (int i = 1; i < 8; ++i) {{
        const unsigned y = values[first + i], x = result;
        result = {combine};
    }}
""",
    )


OR_REDUCE = _reduce("x | y")
MIN_REDUCE = _reduce("y < x ? y : x")
ADD_REDUCE = _reduce("x + y")
# The x of the group's i-th thread.
BROADCAST = _of_group("return __shfl_sync(all, x, i, 8);", "const unsigned result = values[first + i];")
# One bit per lane of the warp, or of the group, whose x is true.
_COLLECT = """
    unsigned result = 0;
    for (int i = 0; i < 8; ++i) result |= (values[first + i] ? 1u : 0u) << i;
"""
VOTE_1 = _of_group("return __ballot_sync(all, x);", _COLLECT)
GROUP_VOTE_1 = _of_group("return __ballot_sync(all, x) >> (threadIdx.x & 24u) & 255u;", _COLLECT)
VOTE_8 = """
#if defined(__CUDA_ARCH__)
    return __ballot_sync(0xffffffffu, x);
#else
    return x ? 1u : 0u;
#endif
"""

SYNC = """
#if defined(__CUDA_ARCH__)
    __syncwarp();
#else
    WP_TILE_SYNC();
#endif
"""

# The number of the thread's warp in the launch, and of the thread within it. A block's last warp may have
# fewer than 32 threads.
WARP_INDEX = """
#if defined(__CUDA_ARCH__)
    return (int)(blockIdx.x * ((blockDim.x + 31u) / 32u) + threadIdx.x / 32u);
#else
    return thread / WIDTH;
#endif
"""
WARP_LANE = """
#if defined(__CUDA_ARCH__)
    return (int)(threadIdx.x & 31u);
#else
    return thread % WIDTH;
#endif
"""
# A bit for each lower lane: read anew where it is needed, it takes no register elsewhere.
LANES_BELOW = """
#if defined(__CUDA_ARCH__)
    unsigned lanes;
    asm volatile("mov.u32 %0, %%lanemask_lt;" : "=r"(lanes));
    return lanes;
#else
    return (1u << thread % WIDTH) - 1u;
#endif
"""
WARP_WIDTH = """
#if defined(__CUDA_ARCH__)
    return 32;
#else
    return WIDTH;
#endif
"""


@wp.func
def _same(x: wp.uint32):
    return x


@wp.func
def _only(x: wp.uint32, i: int):
    return x


@wp.func_native(OR_REDUCE)
def _or_of_group(x: wp.uint32) -> wp.uint32: ...


@wp.func_native(MIN_REDUCE)
def _min_of_group(x: wp.uint32) -> wp.uint32: ...


@wp.func_native(ADD_REDUCE)
def _sum_of_group(x: wp.uint32) -> wp.uint32: ...


@wp.func_native(BROADCAST)
def _broadcast(x: wp.uint32, i: int) -> wp.uint32: ...


@wp.func_native(VOTE_1)
def _vote_1(x: wp.uint32) -> wp.uint32: ...


@wp.func_native(VOTE_8)
def _vote_8(x: wp.uint32) -> wp.uint32: ...


@wp.func_native(GROUP_VOTE_1)
def _lanes_of_group(x: wp.uint32) -> wp.uint32: ...


@wp.func
def _nothing():
    pass


@wp.func_native(SYNC)
def _sync_warp(): ...


def expected_lanes(lanes: object) -> Lanes:
    """8 or 1; ValueError for all else."""
    if isinstance(lanes, bool) or not isinstance(lanes, (int, np.integer)) or lanes not in (8, 1):
        raise ValueError(f"lanes: expected 8 or 1, got {lanes!r}")
    return 8 if lanes == 8 else 1


def collectives(length: int) -> SimpleNamespace:
    """What the threads of a ray tell each other: or, minimum, sum, the value of one of them; and a barrier.

    group_vote: a bit for each thread whose value is not zero; the value itself if there is one thread.
    All threads of a warp (`warp_of`) call them together, those whose value does not matter, too.
    """
    if expected_lanes(length) == 8:
        return SimpleNamespace(
            or_reduce=_same,
            min_reduce=_same,
            sum_reduce=_same,
            group_vote=_same,
            broadcast=_only,
            sync=_nothing,
        )
    return SimpleNamespace(
        or_reduce=_or_of_group,
        min_reduce=_min_of_group,
        sum_reduce=_sum_of_group,
        group_vote=_lanes_of_group,
        broadcast=_broadcast,
        sync=_sync_warp,
    )


@functools.cache
def warp_of(length: int) -> SimpleNamespace:
    """The threads that loop together: a warp on CUDA, the threads of one ray on the CPU device.

    vote: one bit per lane whose value is not zero. index, lane, lanes_below: of a thread, by its number in
    the launch.
    width: the threads of a whole warp; rays: how many rays it traces at once.
    """
    threads = 8 // expected_lanes(length)

    @wp.func_native(WARP_INDEX.replace("WIDTH", str(threads)))
    def index(thread: int) -> int: ...

    @wp.func_native(WARP_LANE.replace("WIDTH", str(threads)))
    def lane(thread: int) -> int: ...

    @wp.func_native(LANES_BELOW.replace("WIDTH", str(threads)))
    def lanes_below(thread: int) -> wp.uint32: ...

    @wp.func_native(WARP_WIDTH.replace("WIDTH", str(threads)))
    def width() -> int: ...

    @wp.func
    def rays():
        return width() // threads

    vote = _vote_8 if threads == 1 else _vote_1
    return SimpleNamespace(
        vote=vote, index=index, lane=lane, lanes_below=lanes_below, width=width, rays=rays, threads=threads
    )
