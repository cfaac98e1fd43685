"""A scene of float64 vertices keeps them, traces in float64 and returns float64."""

import tracemalloc

import numpy as np
import pytest
from support.doubles import CPU, UTM, rays64, soup64, survey
from support.meshes import TRIANGLE, all_crossings, assert_same_hits, random_rays, soup, sphere

import wive


@pytest.fixture(params=CPU)
def cpu(request):
    return request.param


def message(error):
    text = str(error.value)
    assert "\n" not in text
    return text


def test_float64_vertices_make_a_float64_scene_and_all_else_a_float32_one():
    vertices, faces = TRIANGLE
    kinds = {
        "float64": [vertices.astype(np.float64), vertices.astype(">f8"), np.asfortranarray(vertices, "f8")],
        "float32": [
            vertices,
            vertices.astype(np.float16),
            vertices.astype(int),
            vertices.tolist(),
            [np.float64(row) for row in vertices],
            tuple(map(tuple, vertices)),
        ],
    }
    for precision, arrays in kinds.items():
        for array in arrays:
            scene = wive.Scene(array, faces)
            hits, every = (
                query([[0.2, 0.3, 0]], [[0, 0, 1]]) for query in (scene.intersect, scene.intersect_all)
            )
            assert scene.precision == precision
            for found in (scene.vertices, scene.bounds, hits.t, hits.uv, hits.vertices, every.t, every.uv):
                assert found.dtype == precision
            assert hits.prim.dtype == every.prim.dtype == np.int32
            assert hits.t[0] == 1


def test_hits_at_survey_coordinates_are_right_to_nanometres(cpu):
    vertices, faces = survey()
    scene = wive.Scene(vertices, faces, backend=cpu)
    random = np.random.default_rng(1)
    prim = random.integers(len(faces), size=500)
    weights = random.dirichlet(np.ones(3), 500)
    targets = np.einsum("nk,nkx->nx", weights, vertices[faces[prim]])
    origins = UTM + 0.1 * random.standard_normal((500, 3))
    hits = scene.intersect(origins, targets - origins)
    np.testing.assert_array_equal(hits.prim, prim)
    np.testing.assert_allclose(hits.t, 1, rtol=1e-8)  # targets are rounded to 1e-9 m
    np.testing.assert_allclose(hits.points(), targets, rtol=0, atol=1e-8)
    on_ray = origins + hits.t[:, None] * (targets - origins)
    np.testing.assert_allclose(hits.points(), on_ray, rtol=0, atol=4e-9)
    v0, v1, v2 = (vertices - UTM)[faces[prim]].swapaxes(0, 1)
    normals = np.cross(v1 - v0, v2 - v0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(hits.normals(), normals, rtol=0, atol=1e-12)
    assert repr(scene).endswith("accuracy='watertight', precision='float64')")
    # float32, in which these coordinates are half a metre apart, finds other triangles
    single = wive.Scene(vertices.astype(np.float32), faces, backend=cpu)
    assert (single.intersect(origins, targets - origins).prim == prim).mean() < 0.5


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_every_query_is_brute_force(cpu, accuracy, nodes):
    vertices, faces = soup64(250, seed=2)
    origins, directions = rays64(1500, seed=3)
    t, clearness = all_crossings(vertices, faces, origins, directions)
    clear = clearness.min(axis=1) > 1e-9
    assert clear.mean() > 0.99
    scene = wive.Scene(vertices, faces, backend=cpu, accuracy=accuracy, nodes=nodes)
    rays = origins[clear], directions[clear]
    t = t[clear]
    hits, every = scene.intersect(*rays), scene.intersect_all(*rays)
    np.testing.assert_array_equal(hits.prim, np.where(np.isinf(t.min(axis=1)), -1, t.argmin(axis=1)))
    np.testing.assert_allclose(hits.t, t.min(axis=1), rtol=1e-10)
    np.testing.assert_array_equal(scene.occluded(*rays), np.isfinite(t).any(axis=1))
    np.testing.assert_array_equal(scene.count(*rays), np.isfinite(t).sum(axis=1))
    order = np.argsort(t, axis=1, kind="stable")
    expected = np.take_along_axis(t, order, axis=1)
    np.testing.assert_array_equal(every.prim, order[np.isfinite(expected)])
    np.testing.assert_allclose(every.t, expected[np.isfinite(expected)], rtol=1e-10)
    np.testing.assert_array_equal(every.counts, np.isfinite(t).sum(axis=1))
    assert every.points().dtype == every.normals().dtype == np.float64


def test_stats_count_work_and_change_no_hit(cpu):
    scene = wive.Scene(*soup64(2000, seed=4, size=0.05), backend=cpu)
    rays = rays64(1000, seed=5)
    hits, stats = scene.intersect(*rays, stats=True)
    assert_same_hits(hits, scene.intersect(*rays, threads=1, in_flight=1))
    assert (stats.triangles[hits.mask] >= 1).all()
    assert stats.triangles.mean() < 0.1 * len(scene)
    for query in ("occluded", "count", "intersect_all"):
        _, counted = getattr(scene, query)(*rays, stats=True)
        assert counted.inner_nodes.shape == (1000,)


def test_limits_are_taken_in_float64(cpu):
    vertices, faces = TRIANGLE
    scene = wive.Scene(vertices.astype(np.float64), faces, backend=cpu)
    ray = [[0.25, 0.25, 0]], [[0, 0, 1]]
    below, above = np.nextafter(1.0, [0, 2])
    for tmin, tmax, found in ((1, 1, True), (above, 2, False), (0, below, False), (below, above, True)):
        for limits in ((tmin, tmax), (np.array([tmin]), np.array([tmax]))):
            assert scene.intersect(*ray, *limits).mask[0] == found
            assert scene.occluded(*ray, *limits)[0] == found
            assert scene.count(*ray, *limits)[0] == found


def test_rays_of_any_dtype_are_converted_to_the_scenes(cpu):
    vertices, faces = soup(200, seed=6)
    origins, directions = random_rays(300, seed=7, low=-0.5, high=1.5)
    single = wive.Scene(vertices, faces, backend=cpu)
    double = wive.Scene(vertices.astype(np.float64), faces, backend=cpu)
    for scene in (single, double):
        expected = scene.intersect(origins, directions)
        for change in (
            lambda array: array.astype(np.float64),
            lambda array: array.tolist(),
            lambda array: np.asfortranarray(array),
            lambda array: array.astype(">f8"),
            lambda array: array.astype(np.longdouble),
        ):
            hits = scene.intersect(change(origins), change(directions))
            assert_same_hits(hits, expected)
            assert hits.t.dtype == scene.precision


def test_float64_rays_and_vertices_are_not_copied():
    count = 200_000
    vertices, faces = survey(0)
    scene = wive.Scene(vertices, faces)
    assert np.shares_memory(scene.vertices, vertices)
    with pytest.raises(ValueError, match="read-only"):
        scene.vertices[0] = 1
    assert vertices.flags.writeable
    origins, directions = rays64(count, seed=8)

    def most_bytes(*rays):
        tracemalloc.start()
        scene.intersect(*rays)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    results = count * (8 + 4 + 16)
    assert most_bytes(origins, directions) < results + origins.nbytes / 2
    assert most_bytes(origins.astype(np.float32), directions) > origins.nbytes


def test_numbers_beyond_float32_are_ordinary_and_beyond_the_limit_named():
    vertices, faces = TRIANGLE
    scene = wive.Scene(vertices.astype(np.float64), faces)
    hits = scene.intersect([[0.25, 0.25, 0]] * 2, [[0, 0, 1e-200], [0, 0, 1e200]])
    np.testing.assert_allclose(hits.t, [1e200, 1e-200], rtol=1e-15)
    assert not scene.occluded([1e300, 0, 0], [1, 0, 0]).any()
    for value in (np.nan, np.inf, 1e300):
        broken = np.repeat(vertices.astype(np.float64), 7, axis=0)
        broken[17, 1] = value
        with pytest.raises(ValueError, match="17") as error:
            wive.Scene(broken, faces + 16)
        assert "vert" in message(error)


def test_invalid_rays_miss(cpu):
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices.astype(np.float64), faces, backend=cpu)
    nan, inf = np.nan, np.inf
    for origin, direction, *limits in (
        ([nan, 0, 0], [0, 0, 1]),
        ([0, inf, 0], [0, 0, 1]),
        ([0, 0, 0], [0, -0.0, 0]),
        ([0, 0, 0], [nan, 0, 1]),
        ([0, 0, 0], [0, 0, -inf]),
        ([0, 0, 0], [0, 0.1, 1], 2, 1),
        ([0, 0, 0], [0, 0.1, 1], nan, 1),
    ):
        for query in ("intersect", "occluded", "count"):
            found = getattr(scene, query)(np.array([origin], float), np.array([direction], float), *limits)
            assert not np.any(found.mask if query == "intersect" else found)


def test_exact_takes_float64_that_float32_can_hold_and_names_what_it_cannot(tmp_path):
    vertices, faces = soup(100, seed=11)
    rays = random_rays(300, seed=12, low=-0.5, high=1.5)
    scene = wive.Scene(vertices.astype(np.float64), faces, accuracy="exact")
    assert scene.precision == "float32"
    assert_same_hits(scene.intersect(*rays), wive.Scene(vertices, faces, accuracy="exact").intersect(*rays))
    doubles = vertices.astype(np.float64)
    doubles[[42, 77], 1] = 0.1
    with pytest.raises(ValueError) as error:
        wive.Scene(doubles, faces, accuracy="exact")
    x, _, z = doubles[42]
    assert message(error) == (
        f"vertices must be float32 numbers for accuracy 'exact', got vertices[42] = [{x}, 0.1, {z}]: "
        "round them with vertices.astype(np.float32), or use accuracy 'watertight'"
    )
    doubles[:] = vertices
    doubles[13, 0] = np.nan
    with pytest.raises(ValueError, match="13"):
        wive.Scene(doubles, faces, accuracy="exact")


def test_rendering_refuses_float64_in_one_line():
    vertices, faces = survey(1)
    with pytest.raises(ValueError) as error:
        wive.render(wive.Scene(vertices, faces), shading="path", width=8, height=8, spp=1)
    assert message(error) == (
        "scene must be of float32 vertices to be path-traced, got float64: use another shading, or "
        "make one with (vertices - vertices.mean(axis=0)).astype(np.float32)"
    )


def test_empty_meshes_and_no_rays_answer_in_float64(cpu):
    none = np.zeros((0, 3))
    for mesh in ((none, none.astype(int)), (np.zeros((5, 3)), np.zeros((0, 3), int)), survey(0)):
        scene = wive.Scene(*mesh, backend=cpu)
        hits = scene.intersect(none, none)
        assert (hits.t.dtype, hits.uv.shape, scene.precision) == (np.float64, (0, 2), "float64")
        assert hits.points().shape == hits.normals().shape == (0, 3)
        assert scene.intersect_all(none, none).t.dtype == np.float64
        assert len(scene) or not scene.occluded(*rays64(5, seed=13)).any()


@pytest.mark.parametrize("library", ["warp", "warp.vec3d", "torch"])
def test_arrays_of_other_libraries_answer_in_float64(cpu, library):
    module = pytest.importorskip(library.partition(".")[0])
    mesh, rays = soup64(200, seed=16), rays64(300, seed=17)

    def make(values):
        if library == "torch":
            return module.from_numpy(values)
        vector = library == "warp.vec3d" and values.ndim == 2
        return module.array(values, dtype=module.vec3d if vector else module.float64, device="cpu")

    scene = wive.Scene(make(mesh[0]) if library != "warp.vec3d" else mesh[0], mesh[1], backend=cpu)
    assert scene.precision == "float64"
    expected, hits = scene.intersect(*rays), scene.intersect(*map(make, rays))
    every, wanted = scene.intersect_all(*map(make, rays)), scene.intersect_all(*rays)
    for found, wants in ((hits, expected), (every, wanted)):
        for name in ("t", "prim", "uv"):
            array = np.asarray(getattr(found, name))
            assert array.dtype == getattr(wants, name).dtype
            np.testing.assert_array_equal(array, getattr(wants, name))
        np.testing.assert_array_equal(np.asarray(found.points()), wants.points())
        np.testing.assert_array_equal(np.asarray(found.normals()), wants.normals())
    np.testing.assert_array_equal(np.asarray(hits.error_bound), expected.error_bound)
    np.testing.assert_array_equal(np.asarray(hits.spawn(make(rays[1]))), expected.spawn(rays[1]))
    np.testing.assert_array_equal(np.asarray(scene.count(*map(make, rays))), scene.count(*rays))
    if library.startswith("warp"):
        assert hits.uv.dtype is (module.vec2d if library == "warp.vec3d" else module.float64)


def test_hits_do_not_depend_on_batches_threads_or_instruction_set():
    mesh, rays = soup64(3000, seed=18, size=0.05), rays64(5000, seed=19)
    for accuracy in ("fast", "watertight"):
        expected = wive.Scene(*mesh, backend="scalar", accuracy=accuracy).intersect(*rays)
        for name in CPU:
            scene = wive.Scene(*mesh, backend=name, accuracy=accuracy)
            assert_same_hits(scene.intersect(*rays), expected)
            assert_same_hits(scene.intersect(*rays, threads=1, in_flight=1), expected)
            parts = [scene.intersect(rays[0][i::7], rays[1][i::7]).t for i in range(7)]
            for i, part in enumerate(parts):
                np.testing.assert_array_equal(part, expected.t[i::7])
