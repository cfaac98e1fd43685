"""Graphs of wive.dask: a chunk is traced once, the scene is in the graph once, a process opens it once."""

import gc
import pickle
import threading

import pytest
from support.dask_arrays import (
    COUNT,
    DIRECTIONS,
    ORIGINS,
    da,
    dask,
    in_chunks,
    note_queries,
    same,
    scene_of,
)
from support.meshes import soup

import wive
import wive.dask
from wive import _cpu
from wive.dask.carried import CarriedScene, carried, process_threads


def test_arrays_that_are_computed_together_share_one_trace_per_chunk(monkeypatch):
    traced = note_queries(monkeypatch)
    scene = scene_of()
    hits = wive.dask.intersect(scene, in_chunks(ORIGINS), in_chunks(DIRECTIONS))
    dask.compute(hits.t, hits.prim, hits.normals(), hits.points().sum(), hits)
    assert len(traced) == COUNT // 100
    da.where(hits.mask, hits.t, -1).compute()
    assert len(traced) == 2 * COUNT // 100
    kept = hits.persist()
    assert len(traced) == 3 * COUNT // 100
    dask.compute(kept.t, kept.spawn((0, 0, 1)))
    kept.compute()
    assert len(traced) == 3 * COUNT // 100
    every = wive.dask.intersect_all(scene, in_chunks(ORIGINS), in_chunks(DIRECTIONS))
    dask.compute(every.t, every.ray, every.offsets, every.points(), every)
    assert len(traced) == 4 * COUNT // 100


def test_a_chunk_takes_one_thread_unless_told(monkeypatch):
    traced = note_queries(monkeypatch)
    scene = scene_of()
    rays = in_chunks(ORIGINS, (COUNT, 3)), in_chunks(DIRECTIONS, (COUNT, 3))
    for threads, expected in ((None, 1), (2, 2)):
        for name in ("intersect", "occluded", "count", "intersect_all"):
            dask.compute(getattr(wive.dask, name)(scene, *rays, threads=threads, in_flight=4))
            assert traced.pop()["threads"] == expected
    assert not traced


def test_the_graph_has_the_scene_as_it_was():
    scene = scene_of()
    expected = scene.intersect(ORIGINS, DIRECTIONS).t
    before = wive.dask.intersect(scene, in_chunks(ORIGINS), in_chunks(DIRECTIONS)).t
    again = wive.dask.intersect(scene, in_chunks(ORIGINS), in_chunks(DIRECTIONS)).t
    assert before.name == again.name
    scene.refit(scene.vertices + 0.5)
    after = wive.dask.intersect(scene, in_chunks(ORIGINS), in_chunks(DIRECTIONS)).t
    assert after.name != before.name
    same(before, expected)
    same(after, scene.intersect(ORIGINS, DIRECTIONS).t)


@pytest.mark.parametrize("kept", ["file", "shared memory", "mesh"])
def test_a_graph_of_twenty_chunks_holds_the_scene_once(kept, tmp_path):
    scene = wive.Scene(*soup(5000, seed=3))
    if kept == "file":
        scene.save(tmp_path / "scene")
        scene = wive.load(tmp_path / "scene")
    elif kept == "shared memory":
        scene.share()
    hits = wive.dask.intersect(scene, da.zeros((200, 3), chunks=(10, 3)), (0.0, 0.0, 1.0))
    graph = dict(hits.t.__dask_graph__())
    tasks = [pickle.dumps(task) for key, task in graph.items() if not str(key).startswith("wive-scene-")]
    assert len(tasks) >= 20 and max(map(len, tasks)) < 3000
    (once,) = [pickle.dumps(task) for key, task in graph.items() if str(key).startswith("wive-scene-")]
    mesh = scene.vertices.nbytes + scene.faces.nbytes
    assert len(once) < (mesh + 3000 if kept == "mesh" else 1000)
    assert dask.sizeof.sizeof(carried(scene)[0]) == pytest.approx(mesh if kept == "mesh" else 200, abs=200)


def test_threads_that_open_a_scene_at_once_build_one_tree(monkeypatch):
    vertices, faces = soup(400, seed=7)
    pickled = pickle.dumps(carried(wive.Scene(vertices, faces))[0])
    gc.collect()
    built = []
    build = _cpu.Bvh

    def counted(*args, **options):
        built.append(_cpu.thread_count())
        return build(*args, **options)

    monkeypatch.setattr(_cpu, "Bvh", counted)
    copies = [pickle.loads(pickled) for _ in range(8)]
    assert built == []  # as the scheduler unpickles them
    found: list[wive.Scene] = []
    threads = [threading.Thread(target=lambda one=one: found.append(one.scene)) for one in copies]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(built) == 1 and len({id(scene) for scene in found}) == 1
    found.clear()
    copies.clear()
    gc.collect()
    assert pickle.loads(pickled).scene is pickle.loads(pickle.dumps(pickle.loads(pickled))).scene
    assert len(built) == 1  # the last one stays open
    CarriedScene("another", None, scene_of().__reduce__()).scene  # noqa: B018
    gc.collect()
    del built[:]
    assert pickle.loads(pickled).scene.faces.shape == faces.shape
    assert len(built) == 1


def test_a_scene_that_is_gone_is_one_clear_line(tmp_path):
    scene = scene_of()
    scene.save(tmp_path / "scene")
    loaded = wive.load(tmp_path / "scene")
    pickled = pickle.dumps(carried(loaded)[0])
    del loaded
    gc.collect()
    (tmp_path / "scene").unlink()
    with pytest.raises(FileNotFoundError, match=r"^worker on \S+: .*scene: no such file, and the scene"):
        pickle.loads(pickled).scene  # noqa: B018
    scene.share()
    pickled = pickle.dumps(carried(scene)[0])
    del scene
    gc.collect()
    with pytest.raises(FileNotFoundError, match=r"; workers on other machines need a scene saved to a file"):
        pickle.loads(pickled).scene  # noqa: B018
    assert process_threads() is None


def test_scenes_on_a_warp_device_trace_there(device, monkeypatch):
    traced = note_queries(monkeypatch)
    scene = scene_of(device=device)
    expected = scene.intersect(ORIGINS, DIRECTIONS)
    hits = wive.dask.intersect(scene, in_chunks(ORIGINS, (300, 3)), in_chunks(DIRECTIONS, (300, 3)))
    traced.clear()
    same(hits.t, expected.t)
    assert [options["threads"] for options in traced] == [None, None]
    same(hits.points(), expected.points())
    assert hits.compute().mask.sum() == expected.mask.sum()
    with pytest.raises(ValueError, match=r"^threads is only for CPU backends"):
        wive.dask.count(scene, in_chunks(ORIGINS), (0, 0, 1), threads=1)
    again = pickle.loads(pickle.dumps(carried(scene)[0]))
    assert again.scene.device == device
