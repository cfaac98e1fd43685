"""Several Python threads use one scene, with or without an interpreter lock: all get what one thread gets."""

import copy
import gc
import itertools
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pytest
from support.at_once import at_once
from support.meshes import random_rays, soup, sphere

import wive

RAYS = random_rays(1000, seed=1)
POINTS = np.random.default_rng(2).uniform(-1.2, 1.2, (500, 3)).astype(np.float32)
VERTICES, FACES = sphere(3)
TWO = [(VERTICES, FACES), (VERTICES * np.float32(0.5), FACES)]

OUTPUTS: dict[str, Callable[[wive.Hits], np.ndarray]] = {
    "geom": lambda hits: hits.geom,
    "geom_prim": lambda hits: hits.geom_prim,
    "mask": lambda hits: hits.mask,
    "points": lambda hits: hits.points(),
    "normals": lambda hits: hits.normals(),
    "error_bound": lambda hits: hits.error_bound,
    "front": lambda hits: hits.front,
    "cosines": lambda hits: hits.cosines(),
    "interpolate": lambda hits: hits.interpolate(np.concatenate([mesh[0] for mesh in TWO])),
    "spawn": lambda hits: hits.spawn([0, 0, 1]),
}
QUERIES: dict[str, Callable[[wive.Scene], list[np.ndarray]]] = {
    "intersect": lambda scene: list(parts(scene.intersect(*RAYS))),
    "occluded": lambda scene: [scene.occluded(*RAYS)],
    "count": lambda scene: [scene.count(*RAYS)],
    "intersect_all": lambda scene: [(all_hits := scene.intersect_all(*RAYS)).offsets, *parts(all_hits)],
    "closest": lambda scene: [(found := scene.closest(POINTS)).distance, found.prim, found.uv],
    "contains": lambda scene: [scene.contains(POINTS)],
    "contains, by winding": lambda scene: [scene.contains(POINTS, sign="winding")],
    "signed_distance": lambda scene: [scene.signed_distance(POINTS)],
    "visible": lambda scene: [scene.visible(POINTS[:250], POINTS[250:])],
}


def parts(hits: wive.Hits | wive.AllHits) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return hits.t, hits.prim, hits.uv


def assert_same(found: list[np.ndarray], expected: list[np.ndarray]) -> None:
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.fixture(autouse=True)
def switch_often() -> Iterator[None]:
    """Make an interpreter with a lock change threads after nearly every step."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


@pytest.fixture
def threads_as_before() -> Iterator[None]:
    yield
    wive.set_threads(None)


@pytest.mark.parametrize("name", QUERIES)
def test_the_first_queries_of_a_scene_may_come_at_once(backend, name):
    if backend == "warp" and name != "intersect":
        pytest.skip("warp: one query, as each compiles kernels of its own")
    query = QUERIES[name]
    expected = query(wive.Scene.from_meshes(TWO, backend=backend))
    scene = wive.Scene.from_meshes(TWO, backend=backend)
    for answer in at_once(lambda _: query(scene)):
        assert_same(answer, expected)


@pytest.mark.parametrize("name", QUERIES)
def test_the_first_queries_of_a_loaded_scene_may_come_at_once(tmp_path, name):
    query = QUERIES[name]
    scene = wive.Scene.from_meshes(TWO)
    scene.save(tmp_path / "scene")
    loaded = wive.load(tmp_path / "scene")
    for answer in at_once(lambda _: query(loaded)):
        assert_same(answer, query(scene))


def test_outputs_of_hits_may_be_read_at_once(backend):
    scene = wive.Scene.from_meshes(TWO, backend=backend)
    expected = [read(scene.intersect(*RAYS)) for read in OUTPUTS.values()]
    hits = scene.intersect(*RAYS)
    shift = len(OUTPUTS) // 8 + 1

    def read_all(i: int) -> list[np.ndarray]:
        order = np.roll(list(OUTPUTS), shift * i)  # another output first in each thread
        found = {name: OUTPUTS[name](hits) for name in order}
        return [found[name] for name in OUTPUTS]

    for answer in at_once(read_all):
        assert_same(answer, expected)


def test_unpickled_hits_may_look_their_mesh_up_in_many_threads(tmp_path):
    wive.Scene.from_meshes(TWO).save(tmp_path / "scene")
    scene = wive.load(tmp_path / "scene")
    hits = scene.intersect(*RAYS)
    expected = [hits.points(), hits.normals()]
    pickled = pickle.dumps(hits)
    del scene
    for _ in range(3):
        del hits  # nobody holds the tree: the first that needs it opens the file again
        gc.collect()
        hits = pickle.loads(pickled)
        for answer in at_once(lambda _, hits=hits: [hits.points(), copy.deepcopy(hits).normals()]):
            assert_same(answer, expected)


def test_threads_that_open_one_file_get_one_tree(tmp_path, monkeypatch):
    from wive._internal import stored_scenes

    original = stored_scenes.tree_of
    wive.Scene(VERTICES, FACES).save(tmp_path / "scene")
    all_there = threading.Barrier(8)

    def tree_of(*arguments):
        all_there.wait(60)
        return original(*arguments)

    monkeypatch.setattr(stored_scenes, "tree_of", tree_of)
    scenes = at_once(lambda _: wive.load(tmp_path / "scene"))
    assert len({id(scene._bvh) for scene in scenes}) == 1


def test_a_mesh_has_one_name_whoever_asks_first(monkeypatch):
    from wive._internal import known_meshes

    def urandom(count: int) -> bytes:
        time.sleep(0.01)  # others come meanwhile
        return next(numbers).to_bytes(count, "big")

    numbers = itertools.count(1)
    monkeypatch.setattr(known_meshes.os, "urandom", urandom)
    vertices = VERTICES.copy()
    tokens = at_once(lambda _: known_meshes.make_known(vertices, FACES, None))
    assert len(set(tokens)) == 1


def test_pickled_scenes_and_hits_of_several_threads_belong_together():
    scenes = [wive.Scene(*soup(50, seed)) for seed in range(3)]

    def there_and_back(i: int) -> None:
        for _ in range(5):
            scene = wive.Scene(*soup(50, i))  # comes and goes
            for used in (scene, scenes[i % 3]):
                hits = used.intersect(*RAYS)
                assert_same([pickle.loads(pickle.dumps(hits)).points()], [hits.points()])
                again = pickle.loads(pickle.dumps(used))
                assert_same(list(parts(again.intersect(*RAYS))), list(parts(hits)))

    at_once(there_and_back)


def test_a_shared_scene_is_found_while_other_trees_come_and_go(tmp_path):
    scene = wive.Scene(VERTICES, FACES)
    scene.share()
    pickled = pickle.dumps(scene)
    for i in range(4):
        wive.Scene(*soup(20, i)).save(tmp_path / str(i))

    def work(i: int) -> None:
        for _ in range(30):
            if i < 4:
                wive.load(tmp_path / str(i))
            else:
                assert pickle.loads(pickled)._bvh is scene._bvh

    at_once(work)


def test_sharing_at_once_shares_one_tree_and_loses_no_refit(monkeypatch):
    import wive.scene

    original, moved = wive.scene.share, VERTICES + np.float32(1)

    def share(*arguments):
        if scene.vertices is not refitted.get("vertices"):
            scene.refit(moved)  # as another thread may, between what `share` reads and what it sets
            refitted["vertices"] = scene.vertices
        return original(*arguments)

    scene, refitted = wive.Scene(VERTICES, FACES), {}
    monkeypatch.setattr(wive.scene, "share", share)
    scene.share()
    np.testing.assert_array_equal(scene.vertices, moved)
    assert scene._bvh.source is not None

    monkeypatch.setattr(wive.scene, "share", original)
    scene = wive.Scene(VERTICES, FACES)
    names = at_once(lambda _: (scene.share(), scene._bvh.source.place.name)[1])
    assert len(set(names)) == 1


def test_queries_see_old_or_new_positions_while_others_refit(backend):
    scene = wive.Scene(VERTICES, FACES, backend=backend)
    positions = [VERTICES, VERTICES * np.float32(0.5)]
    allowed = [list(parts(wive.Scene(at, FACES, backend=backend).intersect(*RAYS))) for at in positions]

    def work(i: int) -> None:
        for turn in range(10):
            if i < 2:
                scene.refit(positions[(i + turn) % 2])
            else:
                found = scene.intersect(*RAYS)
                (expected,) = (one for one in allowed if np.array_equal(one[0], found.t))
                assert_same(list(parts(found)), expected)

    at_once(work)


@pytest.mark.parametrize("name", QUERIES)
def test_the_number_of_threads_may_change_while_others_query(threads_as_before, name):
    scene = wive.Scene.from_meshes(TWO)
    query = QUERIES[name]
    expected = query(scene)

    def work(i: int) -> None:
        for turn in range(5):
            if i < 2:
                wive.set_threads([1, 3, None][(i + turn) % 3])
            else:
                assert_same(query(scene), expected)

    at_once(work, 6)


def test_scenes_are_built_refitted_saved_and_loaded_in_many_threads(tmp_path):
    def work(i: int) -> list[np.ndarray]:
        vertices, faces = soup(2000, seed=i, size=0.05)
        scene = wive.Scene(vertices, faces, nodes=("float32", "compressed")[i % 2])
        scene.refit(vertices + 1)
        scene.save(tmp_path / str(i))
        return list(parts(wive.load(tmp_path / str(i)).intersect(*RAYS)))

    for alone, together in zip(map(work, range(8)), at_once(work), strict=True):
        assert_same(together, alone)


def test_every_thread_hears_of_its_own_progress_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("wive._internal.progress.PERIOD", 0)
    shared = wive.Scene(VERTICES, FACES)
    wive.Scene.save(shared, tmp_path / "saved")

    def work(i: int) -> list[tuple[int, int, int]]:
        told = []

        def tell(done: int, total: int) -> None:
            told.append((threading.get_ident(), done, total))

        origins, directions = random_rays(1000 + i, seed=i)
        shared.intersect(origins, directions, progress=tell)
        return told

    for i, told in enumerate(at_once(work)):
        idents, done, totals = zip(*told, strict=True)
        assert len(set(idents)) == 1
        assert set(totals) == {1000 + i}
        assert list(done) == sorted(done)
        assert done[-1] == 1000 + i


def test_garbage_is_collected_and_scenes_go_while_others_query():
    scene = wive.Scene(VERTICES, FACES)
    expected = list(parts(scene.intersect(*RAYS)))

    def work(i: int) -> None:
        for _ in range(3):
            if i < 3:
                cycle: list[object] = [wive.Scene(*soup(100, i)).intersect(*RAYS)]
                cycle.append(cycle)
                del cycle
                gc.collect()
            else:
                assert_same(list(parts(scene.intersect(*RAYS))), expected)

    at_once(work)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no interval timers")
def test_ctrl_c_reaches_the_main_thread_and_the_others_go_on():
    scene = wive.Scene(VERTICES, FACES)
    expected = list(parts(scene.intersect(*RAYS)))
    many = np.tile(POINTS, (2000, 1))
    stop, answers = threading.Event(), []

    def others(_: int) -> None:
        while not stop.is_set():
            answers.append(list(parts(scene.intersect(*RAYS))))

    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    beside = threading.Thread(target=partial(at_once, others, 3))
    beside.start()
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(KeyboardInterrupt):
            while True:
                scene.closest(many, threads=1)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        stop.set()
        beside.join()
        signal.signal(signal.SIGALRM, before)
    assert answers
    for answer in answers:
        assert_same(answer, expected)
    assert_same(list(parts(scene.intersect(*RAYS))), expected)


def test_normals_of_the_embreex_scene_may_be_asked_for_at_once():
    from wive.embreex.mesh_construction import TriangleMesh
    from wive.embreex.rtcore_scene import EmbreeScene

    def answer_of(scene: EmbreeScene) -> list[np.ndarray]:
        found = scene.run(*RAYS, output=True)
        return [found[name] for name in ("primID", "geomID", "tfar", "u", "v", "Ng")]

    def new_scene() -> EmbreeScene:
        scene = EmbreeScene()
        for vertices, faces in TWO:
            TriangleMesh(scene, vertices, faces)
        return scene

    expected = answer_of(new_scene())
    for _ in range(5):
        scene = new_scene()
        for answer in at_once(lambda _, scene=scene: answer_of(scene)):
            assert_same(answer, expected)
