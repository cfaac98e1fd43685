"""Rays from far away hit what they hit from near by, and t is the distance from afar."""

import numpy as np
import pytest
from support.meshes import sphere

import wive

DISTANCES = (1e3, 1e5, 1e7, 1e9, 1e12)


@pytest.fixture(scope="module")
def aimed():
    """Points in a unit ball and unit directions, float64."""
    random = np.random.default_rng(5)
    targets, directions = random.uniform(-0.5, 0.5, (300, 3)), random.standard_normal((300, 3))
    return targets, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_rays_from_far_away_hit_what_they_hit_from_near_by(backend, accuracy, nodes, aimed):
    if backend == "warp" and accuracy == "fast":
        pytest.skip("the same path as watertight, and kernels of its own to compile")
    scene = wive.Scene(*sphere(4), backend=backend, accuracy=accuracy, nodes=nodes)
    targets, directions = aimed
    near = scene.intersect(targets - 3 * directions, directions)
    assert near.mask.all()
    for distance in DISTANCES:
        rays = targets - distance * directions, directions
        hits, every = scene.intersect(*rays), scene.intersect_all(*rays)
        lost = 3e-16 * distance  # what float64 resolves of the origins
        np.testing.assert_allclose(hits.points(), near.points(), rtol=0, atol=2e-6 + 20 * lost)
        np.testing.assert_allclose(hits.t, distance - 3 + near.t.astype(np.float64), rtol=1e-7)
        assert (scene.count(*rays) == 2).all()
        np.testing.assert_array_equal(every.t[every.offsets[:-1]], hits.t)
        np.testing.assert_array_equal(every.prim[every.offsets[:-1]], hits.prim)
        assert (np.diff(every.t.reshape(-1, 2)) >= 0).all()


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_float32_rays_from_far_away_are_not_rounded_once_more(backend, accuracy):
    """Unmoved, rounding in the triangle test throws some past the sphere from 1e6 on, and most from 1e7."""
    if backend == "warp" and accuracy == "fast":
        pytest.skip("the same path as watertight, and kernels of its own to compile")
    scene = wive.Scene(*sphere(4), backend=backend, accuracy=accuracy)
    outwards = np.random.default_rng(8).standard_normal((300, 3)).astype(np.float32)
    start = 2 / np.linalg.norm(outwards.astype(np.float64), axis=1)
    near = scene.intersect(start[:, None] * outwards, -outwards)
    for power in (14, 17, 20, 24, 30, 40):
        rays = np.float32(2.0**power) * outwards, -outwards
        hits = scene.intersect(*rays)
        lost = 2.0 ** (power - 50)  # what float64 resolves of the origins, and some
        np.testing.assert_allclose(hits.points(), near.points(), rtol=0, atol=1e-6 + lost)
        np.testing.assert_allclose(hits.t, 2.0**power - start + near.t, rtol=1e-7)
        assert (scene.count(*rays) == 2).all()
        assert scene.occluded(*rays).all()
        assert not scene.occluded(rays[0], outwards).any()
        alone = scene.intersect(rays[0][:1], rays[1][:1])
        np.testing.assert_array_equal(alone.uv, hits.uv[:1])
        as_doubles = scene.intersect(rays[0].astype(np.float64), rays[1])
        for name in ("t", "prim", "uv", "error_bound"):
            np.testing.assert_array_equal(getattr(as_doubles, name), getattr(hits, name))


@pytest.mark.parametrize("distance", [1e14, 1e15, 1e16, 1e17, 9e17])
def test_rays_start_before_the_scene_even_if_float64_does_not_resolve_it(backend, distance):
    """From 1e16 on, neighbouring doubles are farther apart than the scene is large."""
    scene = wive.Scene(*sphere(3), backend=backend)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    beside = np.roll(axes, 1, axis=1) * 0.125 + np.roll(axes, 2, axis=1) * 0.25
    near = scene.intersect(beside - 3 * axes, axes)
    hits = scene.intersect(beside - distance * axes, 2 * axes)
    assert near.mask.all()
    np.testing.assert_array_equal(hits.prim, near.prim)
    np.testing.assert_allclose(hits.points(), near.points(), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(hits.t, np.float32(distance / 2))
    assert (scene.count(beside - distance * axes, axes) == 2).all()
    assert scene.occluded(beside - distance * axes, axes).all()
    assert not scene.occluded(beside - distance * axes, -axes).any()
    assert scene.occluded(beside - distance * axes, -axes, tmin=-np.inf).all()


def test_limits_are_those_of_t_from_afar(backend, aimed):
    scene = wive.Scene(*sphere(3), backend=backend)
    targets, directions = aimed
    for distance in DISTANCES:
        rays = targets - distance * directions, 0.5 * directions
        t, below, above = (scene.intersect(*rays).t for _ in range(3))
        below, above = np.nextafter(t, np.float32(0)), np.nextafter(t, np.float32(np.inf))
        last = scene.intersect_all(*rays).t.reshape(-1, 2)[:, 1]
        for tmin, tmax, some in (
            (0, t, True), (t, t, True), (t, np.inf, True), (-np.inf, np.inf, True),
            (0, below, False), (0, 1, False), (np.nextafter(last, np.float32(np.inf)), np.inf, False),
            (above, below, False), (np.inf, 0, False), (np.nan, np.inf, False), (0, np.nan, False),
        ):  # fmt: skip
            found = scene.intersect(*rays, tmin, tmax)
            assert (found.mask == some).mean() > 0.98  # float32 resolves t from afar to half its last place
            assert ((found.t >= tmin) & (found.t <= tmax))[found.mask].all()
            np.testing.assert_array_equal(scene.occluded(*rays, tmin, tmax), found.mask)
            np.testing.assert_array_equal(scene.count(*rays, tmin, tmax) > 0, found.mask)
        assert scene.occluded(rays[0], -rays[1], -np.inf, 0).all()
        assert not scene.occluded(rays[0], -rays[1]).any()


@pytest.mark.parametrize("limit", [1.0, 3e38, np.inf])
def test_a_hit_whose_t_float32_can_t_hold_is_none_within_limits(backend, limit, aimed):
    scene = wive.Scene(*sphere(4), backend=backend)
    targets, directions = aimed
    for length in (1e-31, 1e-34, 1e-40):
        rays = targets - 1e9 * directions, length * directions
        hits = scene.intersect(*rays, tmax=limit)
        assert (hits.t[hits.mask] == np.inf).all() and (limit == np.inf or not hits.mask.any())
        behind = scene.intersect(rays[0], -rays[1], tmin=-limit, tmax=0)
        assert (behind.t[behind.mask] == -np.inf).all() and (limit == np.inf or not behind.mask.any())


def test_each_ray_is_moved_by_itself(backend, aimed):
    scene = wive.Scene(*sphere(3), backend=backend)
    targets, directions = aimed
    distance = 10.0 ** np.random.default_rng(6).uniform(0, 9, len(targets))
    origins = targets - distance[:, None] * directions
    origins[7], directions = np.nan, directions.copy()
    directions[11] = 0
    together = scene.intersect(origins, directions)
    assert together.mask.sum() == len(targets) - 2
    for i in (0, 5, 7, 11, 50, 299):
        alone = scene.intersect(origins[i : i + 1].tolist(), directions[i : i + 1].tolist())
        for name in ("t", "prim", "uv"):
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[i])


def test_rays_that_float32_holds_are_taken_as_they_are_by_exact_scenes(backend, aimed):
    targets, directions = aimed
    rays = np.float32(targets - 1e7 * directions), np.float32(directions)
    doubles = rays[0].astype(np.float64), rays[1].astype(np.float64)
    exact = wive.Scene(*sphere(3), backend=backend, accuracy="exact")
    np.testing.assert_array_equal(exact.intersect(*doubles).prim, exact.intersect(*rays).prim)
    assert not exact.intersect(*rays).mask.all()
    assert exact.intersect(targets - 1e7 * directions, directions).mask.all()
    watertight = wive.Scene(*sphere(3), backend=backend)
    np.testing.assert_array_equal(
        watertight.intersect(*rays).prim, watertight.intersect(rays[0][:, ::1].copy("F"), rays[1]).prim
    )


def test_error_bounds_of_moved_rays_are_those_of_the_rays_given(aimed):
    vertices, faces = sphere(3)
    scene = wive.Scene(vertices, faces)
    targets, directions = aimed
    origins = targets - 1e6 * directions
    hits = scene.intersect(origins, directions)
    v0, v1, v2 = vertices.astype(np.float64)[faces[hits.prim]].swapaxes(0, 1)
    normals = np.cross(v1 - v0, v2 - v0)
    t = np.einsum("ij,ij->i", normals, v0 - origins) / np.einsum("ij,ij->i", normals, directions)
    assert (abs(hits.t - t) <= hits.error_bound).all()
    assert np.median(hits.error_bound) < 0.05


def test_empty_scenes_and_origins_beyond_all_numbers_miss(backend):
    empty = wive.Scene(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), backend=backend)
    assert not empty.occluded([[1e7, 0, 0.1]], [[-1, 0, 0.0]]).any()
    scene = wive.Scene(*sphere(1), backend=backend)
    origins = np.array([[1e19, 0, 0], [1e300, 0, 0], [np.inf, 0, 0], [1e17, 0.01, 0]])
    assert not scene.occluded(origins[:3], [-1.0, 0, 0]).any()
    assert scene.occluded(origins, [-1.0, 0, 0]).tolist() == [False, False, False, True]
