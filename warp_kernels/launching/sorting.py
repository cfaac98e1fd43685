"""Sorts each ray's hits by t, then prim, and writes them to separate arrays: one thread per ray."""

import functools

import warp as wp

from wive.warp_kernels.lanes.layout import NO_PRIM
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.tree.handle import LISTED_HITS

# Shorter lists are sorted by insertion: fewer moves than a heap makes.
SHORT = 16


@functools.cache
def sort_kernel(precision: str = "float32") -> wp.Kernel:
    """The kernel that sorts hits in trees of this precision, with dim n."""
    numbers, hit_type = PRECISIONS[precision], LISTED_HITS[precision]
    real, vec2 = numbers.real, numbers.vec2

    @wp.func
    def comes_before(a: hit_type, b: hit_type):
        """The order of a ray's hits; no two are equal, because no triangle is listed twice."""
        return a.t < b.t or (a.t == b.t and a.prim < b.prim)

    @wp.func
    def sort_short(hits: wp.array(dtype=hit_type), begin: int, end: int):
        """Insertion sort."""
        for i in range(begin + 1, end):
            moving = hits[i]
            at = int(i)
            while at > begin and comes_before(moving, hits[at - 1]):
                hits[at] = hits[at - 1]
                at -= 1
            hits[at] = moving

    @wp.func
    def sift_down(hits: wp.array(dtype=hit_type), begin: int, place: int, count: int):
        """Move the hit at `place` in a heap of `count` down until none below it comes later."""
        at = int(place)
        moving = hits[begin + at]
        child = 2 * at + 1
        while child < count:
            if child + 1 < count and comes_before(hits[begin + child], hits[begin + child + 1]):
                child += 1
            if not comes_before(moving, hits[begin + child]):
                break
            hits[begin + at] = hits[begin + child]
            at = child
            child = 2 * at + 1
        hits[begin + at] = moving

    @wp.func
    def sort_long(hits: wp.array(dtype=hit_type), begin: int, end: int):
        """Heapsort: n log n steps whatever the order, and no memory."""
        count = end - begin
        for i in range(count // 2):
            sift_down(hits, begin, count // 2 - 1 - i, count)
        for i in range(count - 1):
            last = begin + count - 1 - i
            moving = hits[last]
            hits[last] = hits[begin]
            hits[begin] = moving
            sift_down(hits, begin, 0, count - 1 - i)

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def sort_hits(
        offsets: wp.array(dtype=wp.int64),
        remaining: wp.array(dtype=wp.int32),
        hits: wp.array(dtype=hit_type),
        t: wp.array(dtype=real),
        prim: wp.array(dtype=wp.int32),
        uv: wp.array(dtype=vec2),
    ):
        """`remaining` is 0 unless a traversal was cut short: the places that it left are misses."""
        i = wp.tid()
        begin = wp.int32(offsets[i])
        end = wp.int32(offsets[i + 1])
        for k in range(remaining[i]):
            missing = hit_type()
            missing.t = real(wp.inf)
            missing.u = real(wp.nan)
            missing.v = real(wp.nan)
            missing.prim = NO_PRIM
            hits[begin + k] = missing
        if end - begin <= SHORT:
            sort_short(hits, begin, end)
        else:
            sort_long(hits, begin, end)
        for k in range(begin, end):
            hit = hits[k]
            t[k] = hit.t
            prim[k] = hit.prim
            uv[k] = vec2(hit.u, hit.v)

    return sort_hits


@wp.kernel(module="unique", enable_backward=False, grid_stride=False)
def shift_counts(counts: wp.array(dtype=wp.int32), shifted: wp.array(dtype=wp.int64)):
    """The counts behind a zero, with dim n + 1: their running sums are where each ray's hits begin."""
    i = wp.tid()
    if i == 0:
        shifted[i] = wp.int64(0)
    else:
        shifted[i] = wp.int64(counts[i - 1])
