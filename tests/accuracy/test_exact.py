"""accuracy="exact" returns the bits of exact arithmetic on every backend.

The oracle (support/oracle.py) is brute force in integers and fractions.
"""

import functools
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.exact_answers import INFINITE, ZERO, truth_of, wrong_rays
from support.hard_sets import SETS, HardSet, hard_set
from support.oracle import Truth, integers, meetings, truth, truth_within, unit_of

import wive
from wive import _cpu

CPU_KERNELS = [name for name, reason in _cpu.kernels().items() if not reason]


def answers(
    backend: str, rays: HardSet, tmin: np.ndarray, tmax: np.ndarray, accuracy: str = "exact"
) -> Truth:
    if "." in backend:  # a kernel that no backend is named after
        bvh = _cpu.Bvh(rays.vertices, rays.faces, accuracy)
        t, prim, uv, _ = bvh.intersect(backend, rays.origins, rays.directions, tmin, tmax)
        return Truth(t, prim, uv, bvh.occluded(backend, rays.origins, rays.directions, tmin, tmax)[0])
    scene = wive.Scene(rays.vertices, rays.faces, backend=backend, accuracy=accuracy)
    arguments = (
        rays.origins,
        rays.directions,
        *(limit[0] if len(limit) == 1 else limit for limit in (tmin, tmax)),
    )
    hits = scene.intersect(*arguments)
    return Truth(hits.t, hits.prim, hits.uv, scene.occluded(*arguments))


@pytest.mark.parametrize("name", SETS)
def test_hits_are_those_of_exact_arithmetic(backend: str, name: str) -> None:
    right = truth_of(name)
    assert right.occluded.mean() > 0.02  # enough rays hit
    assert len(wrong_rays(answers(backend, hard_set(name), ZERO, INFINITE), right)) == 0


@pytest.mark.parametrize("kernel", [name for name in CPU_KERNELS if name.endswith((".full", ".half"))])
@pytest.mark.parametrize("name", ["small integers", "sphere far away", "mixed exponents"])
def test_other_forms_of_the_kernels_are_as_exact(kernel: str, name: str) -> None:
    assert len(wrong_rays(answers(kernel, hard_set(name), ZERO, INFINITE), truth_of(name))) == 0


@pytest.mark.parametrize("kernel", [name for name in CPU_KERNELS if "." not in name])
@pytest.mark.parametrize("name", SETS)
def test_compressed_trees_are_as_exact(kernel: str, name: str) -> None:
    rays, right = hard_set(name), truth_of(name)
    bvh = _cpu.Bvh(rays.vertices, rays.faces, "exact", nodes="compressed")
    t, prim, uv, _ = bvh.intersect(kernel, rays.origins, rays.directions, ZERO, INFINITE)
    occluded, _ = bvh.occluded(kernel, rays.origins, rays.directions, ZERO, INFINITE)
    assert len(wrong_rays(Truth(t, prim, uv, occluded), right)) == 0


@pytest.mark.timeout(120)
@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize("name", SETS)
def test_compressed_trees_are_as_exact_on_warp(device: str, name: str, lanes: Literal[1, 8]) -> None:
    some = slice(None, None, 6 if lanes == 1 else 1)  # fibers are slow
    rays, right = hard_set(name), truth_of(name)
    scene = wive.Scene(rays.vertices, rays.faces, device=device, accuracy="exact", nodes="compressed")
    arguments = rays.origins[some], rays.directions[some]
    hits = scene.intersect(*arguments, lanes=lanes)
    found = Truth(hits.t, hits.prim, hits.uv, scene.occluded(*arguments, lanes=lanes))
    right = Truth(right.t[some], right.prim[some], right.uv[some], right.occluded[some])
    assert len(wrong_rays(found, right)) == 0


@pytest.mark.timeout(120)
@pytest.mark.parametrize("name", SETS)
def test_eight_threads_a_ray_are_as_exact(device: str, name: str) -> None:
    some = slice(None, None, 6)  # fibers are slow
    rays, right = hard_set(name), truth_of(name)
    scene = wive.Scene(rays.vertices, rays.faces, device=device, accuracy="exact")
    arguments = rays.origins[some], rays.directions[some]
    hits = scene.intersect(*arguments, lanes=1)
    found = Truth(hits.t, hits.prim, hits.uv, scene.occluded(*arguments, lanes=1))
    right = Truth(right.t[some], right.prim[some], right.uv[some], right.occluded[some])
    assert len(wrong_rays(found, right)) == 0


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_these_sets_can_tell_exact_from_rounded(accuracy: str) -> None:
    for name in ("small integers", "slivers", "coincident faces", "thin walls", "nearly in plane"):
        found = answers("scalar", hard_set(name), ZERO, INFINITE, accuracy)
        assert len(wrong_rays(found, truth_of(name))) > 0, name


@functools.cache
def limited(name: str) -> tuple[HardSet, list[tuple[np.ndarray, np.ndarray, Truth]]]:
    """Rays that hit; limits at the reported t and at its neighbours, and what is right within them."""
    first = truth_of(name)
    hit = np.flatnonzero(first.occluded)[:300]
    rays = hard_set(name)
    rays = rays._replace(origins=rays.origins[hit], directions=rays.directions[hit])
    at, everything = first.t[hit], np.full(len(hit), np.inf, np.float32)
    below, above = (np.nextafter(at, side * everything) for side in (-1, 1))
    cases = [(at, everything), (-everything, at), (at, at), (above, everything), (-everything, below)]
    met = meetings(*rays)
    return rays, [(tmin, tmax, truth_within(met, tmin, tmax)) for tmin, tmax in cases]


@pytest.mark.parametrize("name", ["small integers", "thin walls", "subnormal distances", "mixed exponents"])
def test_limits_are_kept_to_exactly(backend: str, name: str) -> None:
    """Limits at the reported t, which may be below, at or above the exact t."""
    rays, cases = limited(name)
    kept = []
    for tmin, tmax, right in cases:
        kept.append(right.occluded)
        assert len(wrong_rays(answers(backend, rays, tmin, tmax), right)) == 0
    assert 0 < np.mean(kept) < 1


def test_threads_flights_and_batches_do_not_change_the_answer() -> None:
    rays = hard_set("small integers")
    scene = wive.Scene(rays.vertices, rays.faces, accuracy="exact")
    for options in ({"threads": 1, "in_flight": 1}, {"threads": 3, "in_flight": 24}, {"in_flight": 7}):
        hits = scene.intersect(rays.origins, rays.directions, **options)
        occluded = scene.occluded(rays.origins, rays.directions, **options)
        found = Truth(hits.t, hits.prim, hits.uv, occluded)
        assert len(wrong_rays(found, truth_of("small integers"))) == 0


# Halves of small integers: zeros, coincidences and collinear points are common.
NUMBERS = st.integers(-6, 6).map(lambda n: np.float32(n / 2))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    arrays(np.float32, (6, 3), elements=NUMBERS),
    arrays(np.int32, (8, 3), elements=st.integers(0, 5)),
    arrays(np.float32, (8, 3), elements=NUMBERS),
    arrays(np.float32, (8, 3), elements=NUMBERS),
)
def test_small_scenes_of_few_bits_are_exact(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> None:
    moving = (directions != 0).any(axis=1)
    rays = HardSet(vertices, faces, origins[moving], directions[moving])
    if not moving.any():
        return
    right = truth(*rays, ZERO, INFINITE)
    bvh = _cpu.Bvh(vertices, faces, "exact")
    for kernel in CPU_KERNELS:
        t, prim, uv, _ = bvh.intersect(kernel, rays.origins, rays.directions, ZERO, INFINITE)
        occluded, _ = bvh.occluded(kernel, rays.origins, rays.directions, ZERO, INFINITE)
        assert len(wrong_rays(Truth(t, prim, uv, occluded), right)) == 0


def test_the_filters_error_bound_holds_and_is_not_far_too_large() -> None:
    used = {name: share_of_bound_used(name) for name in SETS}
    assert all(share <= 1 for share in used.values()), used
    assert max(used.values()) > 0.02


def share_of_bound_used(name: str) -> float:
    """The largest error of the weights over its bound; weights as in triangle_exact.h, errors by integers.

    The bound is the one derived in docs/accuracy.md.
    """
    rays = hard_set(name)
    rays = rays._replace(origins=rays.origins[::24], directions=rays.directions[::24])
    e = 2.0**-53
    o, d = rays.origins.astype(np.float64)[:, None], rays.directions.astype(np.float64)
    axis = np.argmax(np.abs(d), axis=1)
    order = (axis[:, None] + [1, 2, 3]) % 3
    take = functools.partial(np.take_along_axis, axis=-1)
    d = take(d, order)
    slopes = d[:, :2] * (1 / d[:, 2:])
    slopes[np.abs(slopes) < 2.0**-100] = 0
    p = [
        take(corner[None] - o, order[:, None])
        for corner in rays.vertices[rays.faces].astype(np.float64).swapaxes(0, 1)
    ]
    x = [q[..., 0] - slopes[:, None, 0] * q[..., 2] for q in p]
    y = [q[..., 1] - slopes[:, None, 1] * q[..., 2] for q in p]
    aside = np.max(np.abs(x + y), axis=0)
    along = np.max([np.abs(q[..., 2]) for q in p], axis=0)
    bound = (aside + 4 * e * along) * (13 * e * aside + 21 * e * along)
    met = meetings(*rays)
    scale = unit_of(rays.vertices, rays.origins) * 2 + unit_of(rays.directions)
    forward = integers(rays.directions, unit_of(rays.directions))[np.arange(len(d)), axis]
    shift = 2400  # makes every float an integer
    used = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        weight = x[i] * y[j] - y[i] * x[j]
        # All are multiplied by the direction's longest component, in units of 2^(direction's unit - shift).
        for ray, face in np.ndindex(weight.shape):
            along_axis = int(forward[ray])
            exact = int(met.weights[ray, face, k]) << (scale - unit_of(rays.directions) + shift)
            error = abs(to_integer(weight[ray, face], shift) * along_axis - exact)
            allowed = to_integer(bound[ray, face], shift) * abs(along_axis)
            used = max(used, error / allowed if allowed else float(error > 0) * np.inf)
    return used


def to_integer(x: float, shift: int) -> int:
    """x * 2^shift, rounded down."""
    numerator, denominator = float(x).as_integer_ratio()
    return (numerator << shift) // denominator
