"""Every hit along a ray, each once, by ascending t: against brute force, and the same bits everywhere."""

import itertools
import subprocess
import sys
import tempfile

import numpy as np
import pytest
from support.meshes import TRIANGLE, all_crossings, random_rays, soup, sphere

import wive

pytestmark = pytest.mark.timeout(120)

ACCURACIES = ("fast", "watertight", "exact")
ARRAYS = ("offsets", "t", "prim", "uv")


def sheets(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles stacked along z at 1, 2, ..., in shuffled order; triangle i lies at z = heights[i]."""
    heights = np.random.default_rng(0).permutation(count) + 1
    corners = np.tile(np.float32([[-1, -1, 0], [3, -1, 0], [-1, 3, 0]]), (count, 1, 1))
    corners[:, :, 2] = heights[:, None]
    return corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def assert_same_bits(one: wive.AllHits, other: wive.AllHits) -> None:
    for name in ARRAYS:
        mine, theirs = (np.ascontiguousarray(getattr(hits, name)) for hits in (one, other))
        assert mine.dtype == theirs.dtype and mine.shape == theirs.shape
        np.testing.assert_array_equal(mine.view(np.uint8), theirs.view(np.uint8), err_msg=name)


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_hits_are_those_of_brute_force(accuracy, backend):
    vertices, faces = soup(400, seed=1, size=0.4)
    rays = random_rays(1500, seed=2, low=-0.5, high=1.5)
    t, clear = all_crossings(vertices, faces, *rays)
    general = clear.min(axis=1) > 1e-5
    assert general.sum() > 700
    scene = wive.Scene(vertices, faces, accuracy=accuracy, backend=backend)
    found = scene.intersect_all(*rays)
    assert found.counts.max() > 10
    for i in np.flatnonzero(general):
        expected = np.argsort(t[i])[: np.isfinite(t[i]).sum()]
        mine = found[i]
        np.testing.assert_array_equal(np.sort(mine.prim), np.sort(expected))
        np.testing.assert_allclose(mine.t, t[i][mine.prim], rtol=1e-3 if accuracy == "fast" else 1e-6)


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_first_hit_is_the_closest_and_some_hit_is_any(accuracy, backend):
    scene = wive.Scene(*sphere(3), accuracy=accuracy, backend=backend)
    rays = random_rays(3000, seed=3)
    found, closest = scene.intersect_all(*rays), scene.intersect(*rays)
    hit = found.counts > 0
    first = found.offsets[:-1][hit]
    np.testing.assert_array_equal(hit, closest.mask)
    np.testing.assert_array_equal(hit, scene.occluded(*rays))
    for name in ("t", "prim", "uv"):
        np.testing.assert_array_equal(getattr(found, name)[first], getattr(closest, name)[hit])


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_count_is_the_number_of_hits(accuracy, backend):
    scene = wive.Scene(*soup(500, seed=4), accuracy=accuracy, backend=backend)
    rays = random_rays(2000, seed=5, low=0, high=1)
    limits = np.random.default_rng(6).uniform(0, 0.5, (2, 2000)).astype(np.float32)
    counts, found = scene.count(*rays, *limits), scene.intersect_all(*rays, *limits)
    assert counts.dtype == found.counts.dtype == np.int32
    np.testing.assert_array_equal(counts, found.counts)
    np.testing.assert_array_equal(counts, np.bincount(found.ray, minlength=2000))
    assert found.ray.dtype == found.offsets.dtype == np.int64


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_every_backend_gives_the_same_bits(accuracy, backend):
    mesh, rays = soup(2000, seed=7), random_rays(4000, seed=8, low=0, high=1)
    found, stats = wive.Scene(*mesh, accuracy=accuracy, backend=backend).intersect_all(*rays, stats=True)
    expected, counted = wive.Scene(*mesh, accuracy=accuracy, backend="scalar").intersect_all(
        *rays, stats=True
    )
    assert_same_bits(found, expected)
    for mine, theirs in zip(stats, counted, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_results_depend_on_neither_threads_nor_rays_in_flight_nor_batches(backend):
    scene = wive.Scene(*soup(2000, seed=7), backend=backend)
    origins, directions = random_rays(5000, seed=9, low=0, high=1)
    expected = scene.intersect_all(origins, directions)
    choices = [(1, 1), (1, None), (2, 5), (7, 64), (None, 1)] if backend != "warp" else [(None, None)]
    for threads, in_flight in choices:
        settings = {"threads": threads, "in_flight": in_flight}
        assert_same_bits(scene.intersect_all(origins, directions, **settings), expected)
        np.testing.assert_array_equal(scene.count(origins, directions, **settings), expected.counts)
    cuts = [0, 1, 2, 17, 1100, 4999, 5000]
    parts = [scene.intersect_all(origins[a:b], directions[a:b]) for a, b in itertools.pairwise(cuts)]
    joined = [np.concatenate([getattr(part, name) for part in parts]) for name in ARRAYS[1:]]
    offsets = np.concatenate([[0], np.cumsum(np.concatenate([part.counts for part in parts]))])
    assert_same_bits(wive.AllHits(offsets, *joined, scene.vertices, scene.faces), expected)


def test_five_thousand_hits_on_a_ray_are_all_found_in_order(backend):
    vertices, faces = sheets(5000)
    scene = wive.Scene(vertices, faces, backend=backend)
    up, down = [0.0, 0, 1], [0.0, 0, -1]
    origins = np.float32([[0, 0, 0], [0.1, 0, 5001], [9, 9, 0], [0.2, 0, 2500.5]])
    found = scene.intersect_all(origins, np.float32([up, down, up, up]))
    np.testing.assert_array_equal(found.counts, [5000, 5000, 0, 2500])
    np.testing.assert_array_equal(found[0].t, np.arange(1, 5001))
    np.testing.assert_array_equal(found[1].t, np.arange(1, 5001))
    np.testing.assert_array_equal(found[3].t, np.arange(2500) + 0.5)
    heights = vertices[faces[found[0].prim]][:, 0, 2]
    np.testing.assert_array_equal(heights, np.arange(1, 5001))


def test_interval_is_closed(backend):
    scene = wive.Scene(*sheets(9), backend=backend)
    origin, direction = [0.0, 0, 0], [0.0, 0, 2]
    found = scene.intersect_all(origin, direction, 1.0, 3.0)
    np.testing.assert_array_equal(found.t, [1, 1.5, 2, 2.5, 3])
    tmin = np.float32([1, np.nextafter(np.float32(1), np.float32(2)), 3, 4, 0, np.nan])
    tmax = np.float32([np.nextafter(np.float32(3), np.float32(0)), 3, 3, 3, np.nan, 9])
    counts = scene.count(np.zeros((6, 3), np.float32), direction, tmin, tmax)
    np.testing.assert_array_equal(counts, [4, 4, 1, 0, 0, 0])
    np.testing.assert_array_equal(
        scene.intersect_all([0.0, 0, 10], direction, -np.inf, 0).t, -np.arange(9)[::-1] / 2 - 0.5
    )


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_coincident_triangles_are_each_reported_by_ascending_number(accuracy, backend):
    vertices, faces = sphere(1)
    scene = wive.Scene(vertices, np.repeat(faces, 5, axis=0), accuracy=accuracy, backend=backend)
    aims = vertices[faces].mean(axis=1)
    found = scene.intersect_all([0.0, 0, 0], aims)
    np.testing.assert_array_equal(found.counts, np.full(len(faces), 5))
    np.testing.assert_array_equal(found.prim, np.arange(5 * len(faces)))
    assert (found.t.reshape(-1, 5) == found.t[::5, None]).all()


def test_a_ray_through_a_vertex_meets_every_triangle_there(backend):
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces, backend=backend)
    degree = np.bincount(faces.reshape(-1), minlength=len(vertices))
    found = scene.intersect_all([0.0, 0, 0], vertices)
    for i, hits in enumerate(found):
        around = np.flatnonzero((faces == i).any(axis=1))
        assert 1 <= len(hits.t) <= degree[i]
        assert set(hits.prim) <= set(around)


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_closed_sphere_is_passed_an_even_number_of_times_from_outside_and_an_odd_one_from_inside(
    accuracy, backend
):
    scene = wive.Scene(*sphere(3), accuracy=accuracy, backend=backend)
    origins, directions = random_rays(5000, seed=10)
    counts = scene.count(origins, directions)
    distance = np.linalg.norm(origins.astype(np.float64), axis=1)
    outside, inside = distance > 1, distance < 0.98
    assert inside.sum() > 300 and (counts[outside] > 0).sum() > 300
    assert (counts[outside] % 2 == 0).all() and (counts[inside] == 1).all()


def test_invalid_rays_hit_nothing(backend):
    scene = wive.Scene(*TRIANGLE, backend=backend)
    origins, directions = np.tile(np.float32([0.25, 0.25, 0]), (6, 1)), np.tile(np.float32([0, 0, 1]), (6, 1))
    origins[0, 1], origins[1, 0], directions[2, 0] = np.nan, np.inf, np.nan
    directions[3, 2], directions[4] = np.inf, 0
    np.testing.assert_array_equal(scene.count(origins, directions), [0, 0, 0, 0, 0, 1])
    np.testing.assert_array_equal(scene.intersect_all(origins, directions).offsets, [0, 0, 0, 0, 0, 0, 1])


def test_nothing_to_trace_or_to_hit_gives_empty_arrays_of_the_right_shape(backend):
    none = np.zeros((0, 3), np.float32)
    empty = wive.Scene(np.zeros((3, 3), np.float32), np.zeros((0, 3), np.int32), backend=backend)
    rays = random_rays(40, seed=11)
    for scene, given, count in (
        (wive.Scene(*TRIANGLE, backend=backend), (none, none), 0),
        (wive.Scene(*TRIANGLE, backend=backend), (rays[0], rays[1], 0.0, 0.0), 40),
        (empty, rays, 40),
    ):
        found, stats = scene.intersect_all(*given, stats=True)
        np.testing.assert_array_equal(found.offsets, np.zeros(count + 1))
        assert (found.t.shape, found.prim.shape, found.uv.shape) == ((0,), (0,), (0, 2))
        assert found.points().shape == found.normals().shape == (0, 3)
        assert len(found) == len(found.counts) == len(stats.leaves) == count
        assert scene.count(*given).shape == (count,)


def test_points_and_normals_lie_on_the_triangles_hit(backend):
    vertices, faces = sphere(3)
    scene = wive.Scene(vertices, faces, backend=backend)
    origins, directions = random_rays(500, seed=12)
    found = scene.intersect_all(origins, directions)
    along = origins[found.ray] + found.t[:, None].astype(np.float64) * directions[found.ray]
    np.testing.assert_allclose(found.points(), along, atol=1e-6)
    middles = vertices[faces[found.prim]].mean(axis=1, dtype=np.float64)
    outward = np.sum(found.normals() * middles, axis=1) / np.linalg.norm(middles, axis=1)
    assert (outward > 0.99).all()
    closest = scene.intersect(origins, directions)
    hit, first = closest.mask, found.offsets[:-1][closest.mask]
    np.testing.assert_array_equal(found.points()[first], closest.points()[hit])
    np.testing.assert_array_equal(found.normals()[first], closest.normals()[hit])


def test_one_rays_hits_are_views_and_iteration_goes_through_the_rays():
    scene = wive.Scene(*sphere(3))
    found = scene.intersect_all(*random_rays(50, seed=13))
    assert repr(found) == f"AllHits(50 rays, {len(found.t)} hits)"
    for i, hits in enumerate(found):
        assert len(hits) == 1 and len(hits.t) == found.counts[i]
        assert np.shares_memory(hits.t, found.t) or len(hits.t) == 0
        np.testing.assert_array_equal(hits.prim, found.prim[found.ray == i])
        np.testing.assert_array_equal(hits.points(), found.points()[found.ray == i])
    np.testing.assert_array_equal(found[-1].t, found[49].t)
    np.testing.assert_array_equal(np.concatenate([hits.t for hits in found]), found.t)
    for wrong in (50, -51):
        with pytest.raises(IndexError, match=f"ray {wrong} of 50: count from 0 to 49"):
            found[wrong]
    with pytest.raises(TypeError):
        found["0"]


@pytest.mark.parametrize("query", ["intersect_all", "count"])
def test_bad_input_is_refused_in_one_line(query, backend):
    scene = wive.Scene(*TRIANGLE, backend=backend)
    ask = getattr(scene, query)
    good = np.zeros((2, 3), np.float32)
    for rays, settings, message in (
        ((good[:, :2], good), {}, r"origins must have shape \(n, 3\)"),
        ((good, good[:1]), {}, "origins and directions must be equally many, got 2 and 1"),
        ((good, good, [0.0, 1.0, 2.0]), {}, r"tmin must be one number or have shape \(2,\)"),
        ((good, good), {"threads": 0}, "threads must be from 1"),
        ((good, good), {"in_flight": -1}, "in_flight must be from 1"),
        ((good, good), {"lanes": 4}, "lanes must be one of auto, 8, 1, got 4"),
    ):
        with pytest.raises(ValueError, match=message) as caught:
            ask(*rays, **settings)
        assert "\n" not in str(caught.value)


OUT_OF_MEMORY = """
import resource
import numpy as np
import wive

count = 2000
corners = np.tile(np.float32([[-1, -1, 0], [3, -1, 0], [-1, 3, 0]]), (count, 1, 1))
corners[:, :, 2] = np.arange(count)[:, None]
scene = wive.Scene(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
origins = np.tile(np.float32([0, 0, -1]), (100_000, 1))
up = np.float32([0, 0, 1])
scene.intersect_all(origins[:10], up, threads={threads})
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (400 << 20),) * 2)
for _ in range(3):
    try:
        scene.intersect_all(origins, up, threads={threads})
    except MemoryError:
        print("refused")
    print(len(scene.intersect_all(origins[:1000], up, threads={threads}).t))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space as Linux does")
@pytest.mark.parametrize("threads", [1, 2])
def test_more_hits_than_memory_holds_are_a_memory_error_and_nothing_leaks(threads):
    run = subprocess.run(
        [sys.executable, "-c", OUT_OF_MEMORY.format(threads=threads)],
        capture_output=True,
        text=True,
        timeout=100,
        cwd=tempfile.gettempdir(),  # not in the repository, whose source folder has no compiled core
    )
    assert run.stdout.split() == ["refused", "2000000"] * 3, run.stderr
