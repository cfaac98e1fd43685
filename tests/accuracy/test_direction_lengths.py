"""Directions of any length: t counts in their lengths, and the hit is that of a direction of length one."""

from typing import Any

import numpy as np
import pytest
from support.meshes import sphere

import wive

# The smallest and largest powers of two that a component may have, and some between.
POWERS = {
    np.float32: [-149, -140, -127, -126, -100, -1, 0, 1, 60, 126, 127],
    np.float64: [-1074, -1060, -1023, -1022, -500, -1, 0, 1, 500, 1022, 1023],
}
LOOPS: list[dict[str, int]] = [{"in_flight": 1}, {}]


def rays(dtype: type, count: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Rays at a sphere along axes and diagonals: their directions can be scaled by any power of two."""
    random = np.random.default_rng(1)
    origins = np.round(random.uniform(-2, 2, (count, 3)), 2).astype(dtype)
    directions = random.choice([-1, 0, 1], (count, 3)).astype(dtype)
    directions[~directions.any(axis=1)] = 1
    return origins, directions


def assert_same_but_for_scale(found: wive.Hits, usual: wive.Hits, power: int) -> None:
    np.testing.assert_array_equal(found.prim, usual.prim)
    np.testing.assert_array_equal(found.uv, usual.uv)
    with np.errstate(over="ignore", under="ignore"):
        scaled = np.ldexp(usual.t, -power)
    # Where t is subnormal, `exact` rounds it once, ldexp a second time.
    subnormal = np.abs(scaled) < np.finfo(scaled.dtype).tiny
    np.testing.assert_array_equal(found.t[~subnormal], scaled[~subnormal])
    least = np.finfo(scaled.dtype).smallest_subnormal
    np.testing.assert_allclose(found.t[subnormal], scaled[subnormal], rtol=0, atol=least)


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize(
    ("dtype", "accuracy"),
    [(np.float32, "fast"), (np.float32, "watertight"), (np.float32, "exact"), (np.float64, "watertight")],
)
def test_hits_do_not_depend_on_the_length_of_directions(
    backend: str, dtype: Any, accuracy: Any, nodes: Any
) -> None:
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=backend, accuracy=accuracy, nodes=nodes)
    origins, directions = rays(dtype)
    for how in LOOPS if backend != "warp" else [{}]:
        usual = scene.intersect(origins, directions, -np.inf, **how)
        assert usual.mask.any()
        counts = scene.count(origins, directions, -np.inf, **how)
        for power in POWERS[dtype]:
            scaled = np.ldexp(directions, power)
            assert_same_but_for_scale(scene.intersect(origins, scaled, -np.inf, **how), usual, power)
            np.testing.assert_array_equal(scene.count(origins, scaled, -np.inf, **how), counts)
            np.testing.assert_array_equal(scene.occluded(origins, scaled, -np.inf, **how), usual.mask)


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_no_direction_enters_an_empty_lane(backend: str, dtype: Any, nodes: Any) -> None:
    """Few triangles leave most lanes of the root empty; from far away distances are as large as they get."""
    least, most = np.finfo(dtype).smallest_subnormal, np.finfo(dtype).max
    parts = np.array([0.0, -0.0, least, -least, 1, -1, most, -most], dtype)
    directions = np.stack(np.meshgrid(parts, parts, parts), -1).reshape(-1, 3)
    # Across the box test's range of components that count as parallel.
    longest = np.abs(directions).max(axis=1) > 0
    for count in (1, 2, 9):
        vertices = np.concatenate([np.eye(3) * 1e-3 + i for i in range(count)]).astype(dtype)
        faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
        scene = wive.Scene(vertices, faces, backend=backend, nodes=nodes)
        for place in (-1e17, 1e18, 0.0):
            origins = np.full((len(directions), 3), place, dtype)
            hits, stats = scene.intersect(origins, directions, -np.inf, stats=True)
            assert (stats.inner_nodes <= count + 1).all()
            assert not hits.mask[~longest].any()
            np.testing.assert_array_equal(scene.occluded(origins, directions, -np.inf), hits.mask)
            assert (scene.count(origins, directions, -np.inf) >= hits.mask).all()


def test_a_subnormal_direction_hits_from_far_away(backend: str) -> None:
    vertices = 1e16 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    scene = wive.Scene(vertices, [[0, 1, 2]], backend=backend)
    for length in (5e-324, 1e-310, 1e-200, 1.0, 1e200, 1e308):
        hits = scene.intersect([[0.25e16, 0.25e16, 1e16]], [[0, 0, -length]])
        assert hits.prim.tolist() == [0]
        with np.errstate(over="ignore"):
            assert hits.t[0] == pytest.approx(np.float64(1e16) / length)


@pytest.mark.parametrize("tmin_from", [0.5, 1.0])
def test_limits_scale_with_the_direction(backend: str, tmin_from: float) -> None:
    """The triangle lies at t = 1 in multiples of the direction: the closed interval holds it, or just not."""
    scene = wive.Scene(np.float32([[0, 0, 4], [8, 0, 4], [0, 8, 4]]), [[0, 1, 2]], backend=backend)
    for power in (-120, -30, 0, 30, 100):
        t = np.ldexp(np.float32(4), -power)
        direction = np.ldexp(np.float32([0, 0, 1]), power)
        below, above = np.nextafter(t, np.float32(0)), np.nextafter(t, np.float32(np.inf))
        inside = [(t, t), (below, t), (t, above)]
        outside = [(t * np.float32(tmin_from) / 4, below), (above, np.float32(np.inf))]
        for tmin, tmax in inside:
            assert scene.occluded([[1, 1, 0]], direction[None], tmin, tmax)[0]
        for tmin, tmax in outside:
            assert not scene.occluded([[1, 1, 0]], direction[None], tmin, tmax)[0]


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_exact_chooses_the_right_triangle_beyond_the_range_of_t(backend: str, nodes: Any, sign: int) -> None:
    """All t round to an infinity; their order is still that of the exact numbers."""
    random = np.random.default_rng(2)
    vertices = random.random((600, 3)).astype(np.float32)
    faces = np.arange(600, dtype=np.int32).reshape(-1, 3)
    origins = random.random((500, 3)).astype(np.float32)
    scene = wive.Scene(vertices, faces, backend=backend, accuracy="exact", nodes=nodes)
    direction = np.array([0, 0, sign], np.float32)
    usual = scene.intersect(origins, direction, -np.inf)
    assert usual.mask.any()
    for length in (1.4e-45, 1e-44, 1e-39, 1e-37, 1e38):
        hits = scene.intersect(origins, direction * np.float32(length), -np.inf)
        np.testing.assert_array_equal(hits.prim, usual.prim)
        np.testing.assert_array_equal(hits.uv, usual.uv)
