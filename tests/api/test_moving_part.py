"""One of several meshes that moves: its tree changes in place, unless somebody else would see it."""

import pickle
import threading

import numpy as np
import pytest
from support.meshes import assert_same_hits, random_rays, soup, sphere

import wive
from wive import _cpu
from wive._internal import moving_part

RAYS = random_rays(1000, seed=3)
needs_the_lock = pytest.mark.skipif(
    not moving_part._counts_references(), reason="without an interpreter lock no mesh moves in place"
)


def meshes(dtype: type = np.float32) -> list[tuple[np.ndarray, np.ndarray]]:
    """Meshes that overlap, one of them empty."""
    given = soup(300, seed=1), (np.empty((0, 3)), np.empty((0, 3), np.int32)), sphere(2), soup(400, seed=2)
    return [(vertices.astype(dtype), faces) for vertices, faces in given]


@pytest.fixture
def moves(monkeypatch):
    """How each refit of a mesh went: whether it was in place."""
    went: list[bool] = []
    whole = moving_part.move_in_place

    def noted(*arguments):
        went.append(whole(*arguments))
        return went[-1]

    monkeypatch.setattr("wive.scene.move_in_place", noted)
    return went


def address(scene: wive.Scene) -> int:
    return scene._tracer.bvh.units.ctypes.data


def assert_as_new(scene: wive.Scene, given, **options) -> None:
    """The scene answers as a new one over the same meshes."""
    new = wive.Scene.from_meshes(given, **options)
    np.testing.assert_array_equal(scene.vertices, new.vertices)
    np.testing.assert_array_equal(scene.bounds, new.bounds)
    hits, expected = scene.intersect(*RAYS), new.intersect(*RAYS)
    assert_same_hits(hits, expected)
    np.testing.assert_array_equal(hits.points(), expected.points())
    np.testing.assert_array_equal(hits.geom, expected.geom)
    np.testing.assert_array_equal(scene.count(*RAYS), new.count(*RAYS))
    np.testing.assert_array_equal(scene.closest(RAYS[0]).distance, new.closest(RAYS[0]).distance)


@pytest.mark.parametrize(
    ("accuracy", "dtype"),
    [("fast", np.float32), ("exact", np.float32), ("watertight", np.float32), ("watertight", np.float64)],
)
def test_a_mesh_that_moves_is_where_a_new_scene_has_it(moves, backend, accuracy, dtype):
    given, options = meshes(dtype), {"backend": backend, "accuracy": accuracy}
    scene = wive.Scene.from_meshes(given, **options)
    random = np.random.default_rng(5)
    for step in range(3 if backend == "warp" else 20):  # Warp's trees are made anew
        i = int(random.integers(len(given)))
        scale, shift = random.uniform(0.5, 1.5), random.normal(size=3) * 2.0 ** random.integers(-3, 4)
        given[i] = (given[i][0] * dtype(scale) + shift.astype(dtype)).astype(dtype), given[i][1]
        scene.refit(given[i][0], geom=i)
        if step in (2, 9):
            assert_as_new(scene, given, **options)
    assert_as_new(scene, given, **options)
    in_place = backend != "warp" and moving_part._counts_references()
    assert sum(moves) > 15 if in_place else not any(moves)


@needs_the_lock
def test_a_move_takes_no_new_memory(moves):
    given = meshes()
    scene = wive.Scene.from_meshes(given)
    before = address(scene), scene.vertices.ctypes.data
    scene.refit(given[2][0] + 1, geom=2)
    assert (address(scene), scene.vertices.ctypes.data) == before
    assert moves == [True]


@needs_the_lock
def test_hits_of_before_keep_their_positions(moves):
    given = meshes()
    scene = wive.Scene.from_meshes(given)
    hits, kept = scene.intersect(*RAYS), scene.vertices[5:7]
    points, vertices = hits.points(), kept.copy()
    for shift in (1, 2):
        scene.refit(given[0][0] + np.float32(shift), geom=0)
    assert moves == [True, True]
    np.testing.assert_array_equal(hits.points(), points)
    np.testing.assert_array_equal(kept, vertices)
    assert_as_new(scene, [(given[0][0] + np.float32(2), given[0][1]), *given[1:]])


@needs_the_lock
def test_hits_pickled_before_a_move_in_place_do_not_take_the_new_positions(moves):
    given = meshes()
    scene = wive.Scene.from_meshes(given)
    dump = pickle.dumps(scene.intersect(*RAYS))
    scene.refit(given[0][0] + 1, geom=0)
    assert moves == [True]
    with pytest.raises(ValueError, match=r"hits\.with_mesh"):
        pickle.loads(dump).points()
    hits = pickle.loads(pickle.dumps(scene.intersect(*RAYS)))
    np.testing.assert_array_equal(hits.points(), scene.intersect(*RAYS).points())


@pytest.mark.parametrize("hold", ["copy", "tree", "planes"])
def test_others_that_use_the_tree_see_no_move(moves, hold, monkeypatch):
    import copy

    given = meshes()
    scene = wive.Scene.from_meshes(given)
    expected = scene.intersect(*RAYS)
    if hold == "copy":
        other = copy.copy(scene)
    else:
        held = scene._tracer.bvh if hold == "tree" else scene._tracer.bvh.nodes
        before = np.array(held.nodes if hold == "tree" else held)
    monkeypatch.setattr(_cpu.Bvh, "prepare_part", None)  # of no use: not called
    scene.refit(given[0][0] + 1, geom=0)
    assert moves == [False]
    if hold == "copy":
        assert_same_hits(other.intersect(*RAYS), expected)
    else:
        np.testing.assert_array_equal(held.nodes if hold == "tree" else held, before)
    assert_as_new(scene, [(given[0][0] + 1, given[0][1]), *given[1:]])


def test_queries_in_other_threads_see_the_old_positions_or_the_new_ones():
    ground = np.float32([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]), np.int32([[0, 1, 2], [0, 2, 3]])
    plate = ground[0] * np.float32(0.5), ground[1]
    scene = wive.Scene.from_meshes([soup(3000, seed=9), ground, plate])
    scene.refit(soup(3000, seed=9)[0] + 50, geom=0)
    origins = np.tile(np.float32([1, 2, 100]), (20_000, 1))
    seen, stop = set(), threading.Event()

    def look() -> None:
        while not stop.is_set():
            hits = scene.intersect(origins, [0, 0, -1], threads=1)
            z = hits.points()[:, 2]
            seen.add((float(hits.t.min()), float(hits.t.max()), float(z.min()), float(z.max())))

    watchers = [threading.Thread(target=look) for _ in range(2)]
    for watcher in watchers:
        watcher.start()
    for step in range(100):
        scene.refit(plate[0] + np.float32([0, 0, 1 + step % 2]), geom=2)
    stop.set()
    for watcher in watchers:
        watcher.join()
    assert seen <= {(100, 100, 0, 0), (99, 99, 1, 1), (98, 98, 2, 2)}


@needs_the_lock
def test_a_triangle_that_loses_its_area_and_gains_it_again(moves):
    given = meshes()
    scene = wive.Scene.from_meshes(given)
    flat = given[0][0].copy()
    flat[:30] = flat[0]
    for points, in_place in ((flat, True), (given[0][0], False), (given[0][0] + 1, True)):
        scene.refit(points, geom=0)
        assert moves[-1] == in_place
        assert_as_new(scene, [(points, given[0][1]), *given[1:]])


@needs_the_lock
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_scene_that_leaves_for_far_away_gets_a_new_centre(moves, dtype):
    given = [mesh for mesh in meshes(dtype) if len(mesh[1])]
    scene = wive.Scene.from_meshes(given)
    for i, (points, faces) in enumerate(given):
        given[i] = points + dtype(1e6), faces
        scene.refit(given[i][0], geom=i)
    assert moves == [True, True, False]
    rays = RAYS[0] + dtype(1e6), RAYS[1]
    new = wive.Scene.from_meshes(given)
    assert_same_hits(scene.intersect(*rays), new.intersect(*rays))
    steps = scene.intersect(*rays, stats=True)[1].inner_nodes.sum()
    assert steps <= 1.5 * new.intersect(*rays, stats=True)[1].inner_nodes.sum()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 2e18])
def test_a_vertex_out_of_range_is_refused_and_the_scene_stays(bad):
    given = meshes()
    scene = wive.Scene.from_meshes(given)
    scene.refit(given[2][0], geom=2)
    points = given[2][0].copy()
    points[7, 1] = bad
    with pytest.raises(ValueError, match=r"^vertices\[7\]"):
        scene.refit(points, geom=2)
    assert_as_new(scene, given)


@needs_the_lock
def test_signs_follow_a_move(moves):
    given = [sphere(2), (sphere(1)[0] * np.float32(0.2) + np.float32([5, 0, 0]), sphere(1)[1])]
    scene = wive.Scene.from_meshes(given)
    points = np.float32([[5, 0, 0], [0, 5, 0]])
    for sign in ("crossings", "winding"):
        assert scene.contains(points, sign=sign).tolist() == [True, False]
    scene.refit(given[1][0] + np.float32([-5, 5, 0]), geom=1)
    assert moves == [True]
    for sign in ("crossings", "winding"):
        assert scene.contains(points, sign=sign).tolist() == [False, True]


@needs_the_lock
@pytest.mark.parametrize("nodes", ["compressed", "stored"])
def test_trees_that_cannot_change_are_made_anew(moves, nodes, tmp_path):
    given = meshes()
    scene = wive.Scene.from_meshes(given, nodes="compressed" if nodes == "compressed" else "float32")
    if nodes == "stored":
        scene.save(tmp_path / "scene.wive")
        content = (tmp_path / "scene.wive").read_bytes()
        scene = wive.load(tmp_path / "scene.wive")
    points = given[0][0] + 1
    scene.refit(points, geom=0)
    assert moves == [False]
    assert_as_new(scene, [(points, given[0][1]), *given[1:]])
    scene.refit(given[0][0], geom=0)
    assert moves == [False, nodes == "stored"]
    if nodes == "stored":
        assert (tmp_path / "scene.wive").read_bytes() == content
