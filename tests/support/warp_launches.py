"""Every query over a batch of rays, by a C++ kernel or a Warp lane form, and a comparison of the results."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import warp as wp

from wive import _cpu, warp_kernels
from wive.warp_kernels.lanes.precision import PRECISIONS

# One stack size for all trees, so that each kernel is compiled once.
STACK = 128
# The accuracy and precision in which steps of every query are counted; in others, those of the closest hit.
STEPS_OF_ALL = "watertight", "float32"

INFINITE = np.full(1, np.inf, np.float32)
ZERO = np.zeros(1, np.float32)


@dataclasses.dataclass(frozen=True)
class Answers:
    """The results of each query, and its steps."""

    t: np.ndarray
    prim: np.ndarray
    uv: np.ndarray
    occluded: np.ndarray
    steps: np.ndarray  # (n, 3) of the closest hit
    any_steps: np.ndarray | None
    counts: np.ndarray
    count_steps: np.ndarray | None
    offsets: np.ndarray  # of all hits, as the three below
    all_t: np.ndarray
    all_prim: np.ndarray
    all_uv: np.ndarray


def cpu_answers(
    bvh: _cpu.Bvh,
    kernel: str,
    origins: np.ndarray,
    directions: np.ndarray,
    tmin: np.ndarray = ZERO,
    tmax: np.ndarray = INFINITE,
) -> Answers:
    rays = origins, directions, tmin.astype(origins.dtype), tmax.astype(origins.dtype)
    t, prim, uv, steps = bvh.intersect(kernel, *rays, threads=1, in_flight=1, stats=True)
    occluded, any_steps = bvh.occluded(kernel, *rays, threads=1, in_flight=1, stats=True)
    assert steps is not None and any_steps is not None
    counts, count_steps = bvh.count(kernel, *rays, threads=1, in_flight=1, stats=True)
    assert count_steps is not None
    *listed, _ = bvh.intersect_all(kernel, *rays, threads=1)
    return Answers(t, prim, uv, occluded, steps, any_steps, counts, count_steps, *listed)


def warp_answers(
    bvh: _cpu.Bvh,
    lanes: warp_kernels.launching.launch.Lanes,
    origins: np.ndarray,
    directions: np.ndarray,
    tmin: np.ndarray = ZERO,
    tmax: np.ndarray = INFINITE,
    *,
    device: str = "cpu",
) -> Answers:
    tree = dataclasses.replace(warp_kernels.upload(bvh, device), stack=STACK)
    count = len(origins)
    numbers = PRECISIONS[tree.precision]
    dtypes = numbers.vec3, numbers.vec3, numbers.real, numbers.real
    given = zip((origins, directions, tmin, tmax), dtypes, strict=True)
    rays = [wp.array(values, dtype=dtype, device=device) for values, dtype in given]
    t, prim, uv, occluded = (
        wp.zeros(count, dtype=dtype, device=device)
        for dtype in (numbers.real, wp.int32, numbers.vec2, wp.bool)
    )
    counts = wp.zeros(count, dtype=wp.int32, device=device)
    steps = [wp.zeros(count, dtype=wp.vec3i, device=device) for _ in range(3)]
    warp_kernels.launch_closest(tree, *rays, t, prim, uv, stats=steps[0], lanes=lanes)
    # Steps are counted by other kernels, to be compiled. A traversal counts them for every query, so those of
    # any hit and count are compared for one accuracy, and for others the kernels are those that scenes take.
    any_steps, count_steps = steps[1:] if (tree.accuracy, tree.precision) == STEPS_OF_ALL else (None, None)
    warp_kernels.launch_any(tree, *rays, occluded, stats=any_steps, lanes=lanes)
    warp_kernels.launch_count(tree, *rays, counts, stats=count_steps, lanes=lanes)
    offsets = warp_kernels.scan_counts(counts)
    total = int(offsets.numpy()[-1])
    listed = [wp.zeros(total, dtype=dtype, device=device) for dtype in (numbers.real, wp.int32, numbers.vec2)]
    left = wp.clone(counts)
    warp_kernels.launch_all(tree, *rays, left, offsets, *listed, lanes=lanes)
    warp_kernels.check(tree)
    assert not left.numpy().any()
    written = (t, prim, uv, occluded, steps[0], any_steps, counts, count_steps, offsets, *listed)
    return Answers(*(None if array is None else array.numpy() for array in written))


def assert_bit_identical(one: Answers, other: Answers, fields: Sequence[str] | None = None) -> None:
    """Every number of the same bits (any NaN equals any other), but for steps that `one` did not count."""
    for field in fields or [field.name for field in dataclasses.fields(Answers)]:
        mine, theirs = getattr(one, field), getattr(other, field)
        if mine is None:
            continue
        if mine.dtype.kind == "f":
            assert mine.dtype == theirs.dtype
            np.testing.assert_array_equal(np.isnan(mine), np.isnan(theirs), err_msg=field)
            mine, theirs = (np.where(np.isnan(a), 0, a).view(f"u{a.itemsize}") for a in (mine, theirs))
        np.testing.assert_array_equal(mine, theirs, err_msg=field)
