"""Results of queries and behaviour of scenes, on every backend."""

import tracemalloc

import numpy as np
import pytest
from support.meshes import TRIANGLE, all_crossings, assert_same_hits, random_rays, soup, sphere

import wive


def test_a_hit_has_the_t_prim_uv_point_and_normal_of_geometry(backend):
    scene = wive.Scene(*TRIANGLE, backend=backend)
    hits = scene.intersect([[0.25, 0.5, 0.0]], [[0, 0, 2.0]])
    assert (hits.t.dtype, hits.prim.dtype, hits.uv.dtype) == (np.float32, np.int32, np.float32)
    assert hits.t[0] == 0.5
    assert hits.prim[0] == 0
    np.testing.assert_allclose(hits.uv, [[0.25, 0.5]], rtol=1e-6)
    np.testing.assert_allclose(hits.points(), [[0.25, 0.5, 1.0]], rtol=1e-6)
    np.testing.assert_array_equal(hits.normals(), [[0, 0, 1]])


def test_a_miss_is_inf_minus_one_and_nan(backend):
    hits = wive.Scene(*TRIANGLE, backend=backend).intersect([[5, 5, 0]], [[0, 0, 1]])
    assert hits.t[0] == np.inf
    assert hits.prim[0] == -1
    assert not hits.mask[0]
    assert np.isnan(hits.uv).all()
    assert np.isnan(hits.points()).all()
    assert np.isnan(hits.normals()).all()


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_closest_hits_are_those_of_brute_force(backend, accuracy):
    vertices, faces = soup(300, seed=1)
    origins, directions = random_rays(2000, seed=2, low=-0.5, high=1.5)
    t, clearness = all_crossings(vertices, faces, origins, directions)
    clear = clearness.min(axis=1) > 1e-5
    assert clear.mean() > 0.9
    hits = wive.Scene(vertices, faces, backend=backend, accuracy=accuracy).intersect(origins, directions)
    expected = np.where(np.isinf(t.min(axis=1)), -1, t.argmin(axis=1))
    assert 0.3 < hits.mask.mean() < 0.95
    np.testing.assert_array_equal(hits.prim[clear], expected[clear])
    np.testing.assert_allclose(hits.t[clear], t.min(axis=1)[clear], rtol=1e-4, atol=1e-6)


def test_occluded_is_whether_there_is_a_closest_hit(backend):
    scene = wive.Scene(*soup(300, seed=3), backend=backend)
    rays = random_rays(5000, seed=4, low=-0.5, high=1.5)
    for limits in ((0.0, np.inf), (0.3, 0.6)):
        blocked = scene.occluded(*rays, *limits)
        assert blocked.dtype == np.bool_
        assert 0 < blocked.sum() < len(blocked)
        np.testing.assert_array_equal(blocked, scene.intersect(*rays, *limits).mask)


def test_the_interval_of_t_is_closed_at_both_ends(backend):
    scene = wive.Scene(*TRIANGLE, backend=backend)
    below, above = np.nextafter(np.float32(1), np.float32([0, 2]))
    tmin = np.array([1, 0, 1, above, 0, 2], np.float32)
    tmax = np.array([1, 1, 9, 9, below, 1], np.float32)
    rays = np.tile(np.float32([0.25, 0.25, 0]), (6, 1)), np.tile(np.float32([0, 0, 1]), (6, 1))
    expected = [True, True, True, False, False, False]
    np.testing.assert_array_equal(scene.intersect(*rays, tmin, tmax).mask, expected)
    np.testing.assert_array_equal(scene.occluded(*rays, tmin, tmax), expected)


def test_one_limit_for_all_rays_equals_one_for_each(backend):
    scene = wive.Scene(*soup(200, seed=5), backend=backend)
    rays = random_rays(1000, seed=6, low=0, high=1)
    each = np.full(1000, 0.25), np.full(1000, 0.75)
    assert_same_hits(scene.intersect(*rays, 0.25, 0.75), scene.intersect(*rays, *each))


def test_tmin_past_the_first_hit_finds_the_second(backend):
    scene = wive.Scene(*sphere(), backend=backend)
    origin, direction = [0.01, 0.02, -3], [0, 0, 1]
    first = scene.intersect(origin, direction)
    second = scene.intersect(origin, direction, tmin=first.t[0] + 0.1)
    assert first.points()[0, 2] == pytest.approx(-1, abs=0.02)
    assert second.points()[0, 2] == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_every_backend_returns_the_same_bits(usable_backends, accuracy):
    mesh, rays = soup(2000, seed=7), random_rays(20_000, seed=8, low=-0.5, high=1.5)
    first, *others = (wive.Scene(*mesh, backend=name, accuracy=accuracy) for name in usable_backends)
    for other in others:
        assert_same_hits(first.intersect(*rays), other.intersect(*rays))
        np.testing.assert_array_equal(first.occluded(*rays), other.occluded(*rays))


def test_invalid_rays_miss(backend):
    scene = wive.Scene(*sphere(), backend=backend)
    nan, inf = np.nan, np.inf
    good_origin, good_direction = [0.1, 0.2, -3], [0, 0, 1]
    assert scene.occluded(good_origin, good_direction).all()
    origins = [[nan, 0.2, -3], [0.1, inf, -3], [0.1, 0.2, -inf]]
    directions = [
        [0, 0, 0],
        [-0.0, 0, -0.0],
        [nan, 0, 1],
        [0, nan, 1],
        [0, 0, inf],
        [0, 0, -inf],
        [0, 0, nan],
    ]
    for nonsense in ((origins, good_direction), (good_origin, directions)):
        assert not scene.intersect(*nonsense).mask.any()
        assert not scene.occluded(*nonsense).any()
    for limits in ((2, 1), (nan, 1), (0, nan)):
        assert not scene.occluded(good_origin, good_direction, *limits).any()


def test_points_lie_on_their_rays_and_normals_are_unit(backend):
    scene = wive.Scene(*sphere(), backend=backend)
    origins, directions = random_rays(5000, seed=9)
    hits = scene.intersect(origins, directions)
    hit = hits.mask
    assert hit.sum() > 500
    on_ray = origins[hit] + hits.t[hit, None] * directions[hit]
    np.testing.assert_allclose(hits.points()[hit], on_ray, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(hits.normals()[hit], axis=1), 1, rtol=1e-12)
    outwards = np.sum(hits.normals()[hit] * hits.points()[hit], axis=1)
    assert (outwards > 0.9).all()


def test_reversed_winding_reverses_normals(backend):
    vertices, faces = sphere(1)
    rays = random_rays(200, seed=10)
    one = wive.Scene(vertices, faces, backend=backend).intersect(*rays)
    other = wive.Scene(vertices, faces[:, ::-1], backend=backend).intersect(*rays)
    both = one.mask & other.mask
    assert both.any()
    np.testing.assert_allclose(one.normals()[both], -other.normals()[both])


def test_degenerate_triangles_keep_their_number_and_are_never_hit(backend):
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1], [1, 0, -1]]
    faces = [[3, 3, 3], [3, 4, 4], [0, 1, 2]]
    hits = wive.Scene(vertices, faces, backend=backend).intersect(
        [[0, 0, -5], [0.5, 0, -5], [0.25, 0.25, -5]], [0, 0, 1]
    )
    assert set(hits.prim.tolist()) == {2}


def test_any_real_dtype_and_layout_gives_the_hits_of_float32(backend):
    vertices, faces = sphere(2)
    origins, directions = random_rays(500, seed=11)
    expected = wive.Scene(vertices, faces, backend=backend).intersect(origins, directions)
    for change in (
        lambda array: array.astype(array.dtype.str.replace("4", "8")),
        lambda array: array.tolist(),
        lambda array: np.asfortranarray(array),
        lambda array: np.repeat(array, 2, axis=0)[::2],
        lambda array: array.astype(array.dtype.newbyteorder()),
    ):
        changed = change(vertices)
        if getattr(changed, "dtype", None) == np.float64:
            changed = vertices  # makes a float64 scene, tests/api/test_float64_api.py
        scene = wive.Scene(changed, change(faces), backend=backend)
        assert_same_hits(scene.intersect(change(origins), change(directions)), expected)


def test_a_vector_of_shape_3_is_shared_by_all_rays(backend):
    scene = wive.Scene(*sphere(), backend=backend)
    origins, directions = random_rays(100, seed=12)
    origin = np.zeros(3, np.float32)
    assert_same_hits(scene.intersect(origin, directions), scene.intersect(np.zeros((100, 3)), directions))
    assert_same_hits(
        scene.intersect(origins, directions[0]), scene.intersect(origins, np.tile(directions[0], (100, 1)))
    )
    assert len(scene.intersect(origin, directions[0])) == 1


def test_float32_rays_are_not_copied():
    count = 200_000
    scene = wive.Scene(*sphere(0))
    origins, directions = random_rays(count, seed=13)

    def most_bytes(*rays: np.ndarray) -> int:
        tracemalloc.start()
        scene.intersect(*rays)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    results = count * (4 + 4 + 8)
    one_copy = origins.nbytes
    assert most_bytes(origins, directions) < results + one_copy / 2
    assert most_bytes(np.asfortranarray(origins), directions) > one_copy


def test_float32_vertices_are_kept_read_only_and_not_copied():
    vertices, faces = sphere(1)
    scene = wive.Scene(vertices, faces)
    assert np.shares_memory(scene.vertices, vertices)
    assert np.shares_memory(scene.faces, faces)
    for kept in (scene.vertices, scene.faces):
        with pytest.raises(ValueError, match="read-only"):
            kept[0, 0] = 1
    assert vertices.flags.writeable


def test_an_empty_mesh_is_a_scene_that_nothing_hits(backend):
    empty = np.zeros((0, 3), np.float32)
    for mesh in (([], []), (empty, empty.astype(int)), (np.zeros((5, 3), np.float32), [])):
        scene = wive.Scene(*mesh, backend=backend)
        hits, stats = scene.intersect(*random_rays(10, seed=14), stats=True)
        assert len(scene) == 0
        assert not hits.mask.any()
        assert np.isnan(hits.points()).all()
        assert not scene.occluded(*random_rays(10, seed=14)).any()
        assert not stats.triangles.any()
        assert (scene.bounds[0] > scene.bounds[1]).all()


def test_no_rays_give_no_hits(backend):
    scene = wive.Scene(*sphere(0), backend=backend)
    for none in ([], np.zeros((0, 3), np.float32)):
        hits, stats = scene.intersect(none, none, stats=True)
        assert len(hits) == len(stats.inner_nodes) == 0
        assert hits.uv.shape == (0, 2)
        assert hits.points().shape == hits.normals().shape == (0, 3)
        assert scene.occluded(none, none).shape == (0,)


def test_stats_count_work_and_change_no_hit(backend):
    scene = wive.Scene(*soup(3000, seed=15, size=0.05), backend=backend)
    rays = random_rays(2000, seed=16, low=0, high=1)
    hits, closest = scene.intersect(*rays, stats=True)
    blocked, any_hit = scene.occluded(*rays, stats=True)
    assert_same_hits(hits, scene.intersect(*rays))
    np.testing.assert_array_equal(blocked, hits.mask)
    assert isinstance(closest, wive.Stats)
    assert all(counter.shape == (2000,) for counter in closest)
    assert (closest.inner_nodes >= 1).all()
    assert (closest.leaves[hits.mask] >= 1).all()
    assert (closest.triangles[hits.mask] >= 1).all()
    assert closest.triangles.mean() < 0.1 * len(scene)
    missed = ~hits.mask
    assert missed.any()
    for of_any, of_closest in zip(any_hit, closest, strict=True):
        # Without a hit both visit every node in the interval, in any order.
        np.testing.assert_array_equal(of_any[missed], of_closest[missed])
        assert (of_any[hits.mask] >= 1).all()


def test_occluded_stops_at_the_first_hit(backend):
    layers = 1000
    vertices = np.concatenate([TRIANGLE[0] + np.float32([0, 0, z]) for z in range(layers)])
    faces = np.arange(3 * layers).reshape(-1, 3)
    blocked, stats = wive.Scene(vertices, faces, backend=backend).occluded(
        [0.25, 0.25, 0], [0, 0, 1], stats=True
    )
    assert blocked.all()
    assert stats.triangles[0] < 0.05 * layers
    assert stats.inner_nodes[0] < 20


def test_a_scene_has_its_size_bounds_and_options(backend):
    vertices, faces = sphere(2, radius=2)
    scene = wive.Scene(vertices, faces, backend=backend, accuracy="fast")
    assert len(scene) == 320
    assert scene.memory >= 320 * 36
    np.testing.assert_array_equal(scene.bounds, [vertices.min(axis=0), vertices.max(axis=0)])
    assert (scene.backend, scene.accuracy) == (backend, "fast")
    device = ", device='cpu'" if backend == "warp" else ""
    options = f"backend='{backend}'{device}, accuracy='fast', precision='float32'"
    assert repr(scene) == f"Scene(320 triangles, {options})"
    assert repr(scene.intersect([[0, 0, 0], [9, 9, 9]], [1, 1, 1.1])) == "Hits(2 rays, 1 hit)"


def test_auto_is_the_first_usable_backend(usable_backends):
    assert wive.Scene(*TRIANGLE).backend == usable_backends[0]
    assert [name for name in usable_backends if name != "warp"][-1] == "scalar"


def test_unusable_backends_give_a_reason():
    found = wive.backends()
    assert list(found) == ["avx512", "avx2", "scalar", "warp"]
    for backend in found.values():
        assert backend.usable == (backend.reason == "")
        assert "\n" not in backend.reason
    assert not any(found[name].devices for name in ("avx512", "avx2", "scalar"))
