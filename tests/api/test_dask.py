"""wive.dask on threads: hits are the scene's own, a chunk is traced once, bad input is one clear line."""

import gc
import math
import os
import pickle
import re
import subprocess
import sys
import threading

import numpy as np
import pytest
from support.meshes import assert_same_hits, random_rays, soup

import wive
from wive import _cpu

dask = pytest.importorskip("dask")
da = pytest.importorskip("dask.array")

import wive.dask  # noqa: E402
from wive.dask.carried import CarriedScene, carried, process_threads  # noqa: E402

COUNT = 600
ORIGINS, DIRECTIONS = random_rays(COUNT, seed=6)
LIMITS = np.random.default_rng(1).uniform(0, 2, COUNT)
# Unequal chunks, empty ones, the vector axis in pieces, one chunk.
CHUNKS = [((7, 0, 500, 93), (2, 1)), (100, 3), (COUNT, 1)]
OF_HITS = "t", "prim", "uv", "mask", "geom", "geom_prim", "front", "error_bound"
OF_ALL_HITS = "offsets", "counts", "ray", "t", "prim", "uv", "geom", "geom_prim"
METHODS = "points", "normals", "cosines"


def scene_of(**options) -> wive.Scene:
    return wive.Scene(*soup(400, seed=7, dtype=options.pop("dtype", np.float32)), **options)


def in_chunks(array: np.ndarray, chunks=(100, 3)):
    return da.from_array(array, chunks=chunks)


def same(found, expected: np.ndarray) -> None:
    """A dask array that says before what it is when computed, equal to NumPy's."""
    all_same([(found, expected)])


def all_same(pairs: list[tuple]) -> None:
    """Dask arrays, computed together."""
    all_computed = dask.compute(*(found for found, _ in pairs))
    for (found, expected), computed in zip(pairs, all_computed, strict=True):
        assert isinstance(found, da.Array)
        assert type(computed) is type(found._meta) is np.ndarray
        assert computed.dtype == found.dtype == found._meta.dtype == expected.dtype
        assert computed.ndim == found.ndim == found._meta.ndim
        assert all(a == b or math.isnan(a) for a, b in zip(found.shape, computed.shape, strict=True))
        np.testing.assert_array_equal(computed, expected)


@pytest.fixture
def traced(monkeypatch) -> list[dict]:
    """The options of each call of a scene's query."""
    calls: list[dict] = []
    for name in ("intersect", "intersect_all", "occluded", "count"):
        query = getattr(wive.Scene, name)

        def call(self, *rays, query=query, **options):
            calls.append(options)
            return query(self, *rays, **options)

        monkeypatch.setattr(wive.Scene, name, call)
    return calls


@pytest.mark.parametrize(
    ("chunks", "options"),
    [*((chunks, {}) for chunks in CHUNKS), (CHUNKS[0], {"accuracy": "exact"}), (200, {"dtype": np.float64})],
)
def test_every_array_of_hits_is_that_of_the_scene(chunks, options):
    scene = scene_of(**options)
    expected = scene.intersect(ORIGINS, DIRECTIONS)
    hits = wive.dask.intersect(scene, in_chunks(ORIGINS, chunks), in_chunks(DIRECTIONS, (250, 3)))
    assert hits.shape == hits.t.shape == (COUNT,) and len(hits) == COUNT
    pairs = [(getattr(hits, name), getattr(expected, name)) for name in OF_HITS]
    pairs += [(getattr(hits, name)(), getattr(expected, name)()) for name in METHODS]
    for directions in (DIRECTIONS, in_chunks(DIRECTIONS, chunks), (0.0, 0.0, 1.0)):
        pairs.append((hits.spawn(directions), expected.spawn(np.asarray(directions))))
    for values in (scene.vertices, scene.vertices[:, 0].astype(np.float16)):
        pairs.append((hits.interpolate(values), expected.interpolate(values)))
    all_same(pairs)
    whole = hits.compute()
    assert_same_hits(whole, expected)
    np.testing.assert_array_equal(whole.points(), expected.points())
    np.testing.assert_array_equal(whole.spawn(DIRECTIONS), expected.spawn(DIRECTIONS))


@pytest.mark.parametrize("chunks", CHUNKS[:2])
def test_every_array_of_all_hits_is_that_of_the_scene(chunks):
    scene = scene_of()
    expected = scene.intersect_all(ORIGINS, DIRECTIONS, 0.1, LIMITS)
    rays = in_chunks(ORIGINS, chunks), in_chunks(DIRECTIONS, (250, 3))
    hits = wive.dask.intersect_all(scene, *rays, 0.1, in_chunks(LIMITS, 77))
    assert len(hits) == COUNT and len(expected.t) > 200
    pairs = [(getattr(hits, name), getattr(expected, name)) for name in OF_ALL_HITS]
    pairs += [(getattr(hits, name)(), getattr(expected, name)()) for name in ("points", "normals")]
    all_same(pairs)
    chunk_hits = dask.compute(*hits.to_delayed())
    assert sum(map(len, chunk_hits)) == COUNT
    for whole in (hits.compute(), hits.persist().compute()):
        for name in OF_ALL_HITS:
            np.testing.assert_array_equal(getattr(whole, name), getattr(expected, name))
        np.testing.assert_array_equal(whole.points(), expected.points())
        assert whole.counts.dtype == np.int32


@pytest.mark.parametrize("name", ["occluded", "count"])
def test_limits_are_numbers_or_arrays_in_any_chunks(name):
    scene = scene_of()
    rays = in_chunks(ORIGINS), in_chunks(DIRECTIONS, (250, 2))
    query, expected = getattr(wive.dask, name), getattr(scene, name)
    same(query(scene, *rays), expected(ORIGINS, DIRECTIONS))
    for low in (0.25, in_chunks(LIMITS, 41).min(), np.float32(0.25)):
        for high in (LIMITS, in_chunks(LIMITS, 41), list(LIMITS)):
            least = low.compute() if isinstance(low, da.Array) else low
            same(query(scene, *rays, low, high), expected(ORIGINS, DIRECTIONS, least, LIMITS))
    same(query(scene, *rays, tmin=3, tmax=2), expected(ORIGINS, DIRECTIONS, 3, 2))


def test_triangles_that_are_touched_count():
    scene = wive.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    edge = in_chunks(np.array([[0.5, 0, 1], [0, 0.5, 1], [0.5, 0.5, 1], [0.2, 0.2, 1]], np.float32), (2, 3))
    for touching in (False, True):
        expected = scene.count(edge.compute(), (0, 0, -1), touching=touching)
        same(wive.dask.count(scene, edge, (0, 0, -1), touching=touching), expected)
        every = wive.dask.intersect_all(scene, edge, (0, 0, -1), touching=touching)
        same(every.counts, expected)
    assert expected.tolist() == [1, 1, 1, 1]


def test_masked_rays_miss():
    scene = scene_of()
    masked = np.ma.masked_array(ORIGINS, np.arange(3 * COUNT).reshape(-1, 3) % 7 == 0)
    origins = da.ma.masked_array(in_chunks(ORIGINS), in_chunks(np.ma.getmaskarray(masked)))
    same(wive.dask.intersect(scene, origins, in_chunks(DIRECTIONS)).t, scene.intersect(masked, DIRECTIONS).t)


@pytest.mark.parametrize("row", [(0.5, 0.5, -2.0), np.array([0.5, 0.5, -2.0], np.float32)])
def test_a_row_or_an_array_of_numpy_goes_with_a_dask_array(row):
    scene = scene_of()
    same(wive.dask.intersect(scene, row, in_chunks(DIRECTIONS)).t, scene.intersect(row, DIRECTIONS).t)
    same(wive.dask.intersect(scene, in_chunks(ORIGINS), row).t, scene.intersect(ORIGINS, row).t)
    same(wive.dask.count(scene, ORIGINS, in_chunks(DIRECTIONS)), scene.count(ORIGINS, DIRECTIONS))
    lazy = da.from_array(np.array(row), chunks=2)
    same(wive.dask.occluded(scene, lazy, in_chunks(DIRECTIONS)), scene.occluded(row, DIRECTIONS))
    same(wive.dask.occluded(scene, lazy, DIRECTIONS), scene.occluded(row, DIRECTIONS))
    same(wive.dask.intersect(scene, lazy, row).uv, scene.intersect(row, row).uv)


@pytest.mark.parametrize("chunks", [(11, 9, 2), (-1, -1, 3)])
def test_rays_of_a_picture_give_hits_of_its_shape(chunks):
    scene = scene_of()
    shape = (30, 20, 3)
    origins, directions = ORIGINS.reshape(shape), DIRECTIONS.reshape(shape)
    rays = in_chunks(origins, chunks), in_chunks(directions, (11, 20, 3))
    expected = scene.intersect(origins, directions)
    hits = wive.dask.intersect(scene, *rays, tmax=in_chunks(LIMITS.reshape(30, 20) + 9, 10))
    for name in ("t", "uv", "mask"):
        same(getattr(hits, name), getattr(expected, name))
    same(hits.points(), expected.points())
    for whole in (hits.compute(), hits.persist().compute()):
        assert whole.uv.shape == (30, 20, 2)
        np.testing.assert_array_equal(whole.t, expected.t)
        np.testing.assert_array_equal(whole.points(), expected.points())
    flat = scene.intersect_all(ORIGINS, DIRECTIONS, 0, LIMITS)
    every = wive.dask.intersect_all(scene, *rays, 0, LIMITS.reshape(30, 20))
    for name in ("offsets", "ray", "prim"):
        same(getattr(every, name), getattr(flat, name))


@pytest.mark.parametrize("shape", [(0, 3), (0, 5, 3), (4, 0, 3)])
def test_no_rays_have_no_hits(shape):
    scene = scene_of()
    rays = da.zeros(shape), da.ones(shape, dtype=np.float32)
    hits = wive.dask.intersect(scene, *rays)
    same(hits.uv, np.zeros((*shape[:-1], 2), np.float32))
    same(hits.points(), np.zeros(shape))
    assert hits.compute().t.shape == shape[:-1]
    same(wive.dask.occluded(scene, *rays), np.zeros(shape[:-1], bool))
    every = wive.dask.intersect_all(scene, *rays)
    same(every.offsets, np.zeros(1, np.int64))
    same(every.ray, np.zeros(0, np.int64))
    assert len(every.compute()) == 0


def test_rays_that_a_mask_chose_are_in_chunks_of_unknown_sizes():
    scene = scene_of()
    first = scene.intersect(ORIGINS, DIRECTIONS)
    hits = wive.dask.intersect(scene, in_chunks(ORIGINS), in_chunks(DIRECTIONS))
    onward = in_chunks(DIRECTIONS)[hits.mask]
    origins = hits.spawn(in_chunks(DIRECTIONS))[hits.mask]
    given = first.spawn(DIRECTIONS)[first.mask], DIRECTIONS[first.mask]
    same(wive.dask.intersect(scene, origins, onward).t, scene.intersect(*given).t)
    same(wive.dask.count(scene, origins, (0, 0, 1)), scene.count(given[0], (0, 0, 1)))
    every = wive.dask.intersect_all(scene, origins, onward)
    same(every.t, scene.intersect_all(*given).t)
    with pytest.raises(ValueError, match=r"^rays must be in chunks of known sizes to be numbered: call comp"):
        every.ray  # noqa: B018
    with pytest.raises(ValueError, match=r"^directions must be a dask array, as the rays are in chunks"):
        wive.dask.intersect(scene, origins, DIRECTIONS)
    for other in (
        in_chunks(DIRECTIONS)[: first.mask.sum()],
        in_chunks(DIRECTIONS, (50, 3))[da.repeat(hits.mask, 1)],
    ):
        with pytest.raises(
            ValueError, match=r"^origins and directions must be in the same chunks, as some [^\n]*$"
        ):
            wive.dask.occluded(scene, origins, other)


def test_arrays_that_are_computed_together_share_one_trace_per_chunk(traced):
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


def test_a_chunk_takes_one_thread_unless_told(traced):
    scene = scene_of()
    rays = in_chunks(ORIGINS, (COUNT, 3)), in_chunks(DIRECTIONS, (COUNT, 3))
    for threads, expected in ((None, 1), (2, 2)):
        for name in ("intersect", "occluded", "count", "intersect_all"):
            dask.compute(getattr(wive.dask, name)(scene, *rays, threads=threads, in_flight=4))
            assert traced.pop()["threads"] == expected
    assert not traced


def test_the_graph_has_the_scene_as_it_was(traced):
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


RAYS = da.zeros((6, 3), chunks=2), da.ones((6, 3), chunks=3)
REFUSED = [
    (("scene",), {}, TypeError, "scene must be a wive.Scene, got str"),
    ((None, *RAYS), {"threads": 0}, ValueError, "threads must be from 1 to 2147483647, got 0"),
    ((None, *RAYS), {"threads": 1.5}, TypeError, "threads must be an integer, got float 1.5"),
    ((None, *RAYS), {"in_flight": 0}, ValueError, "in_flight must be from 1"),
    ((None, *RAYS), {"lanes": 8}, ValueError, "lanes is only for backend 'warp', got 8 with backend"),
    ((None, *RAYS), {"touching": "yes"}, TypeError, "touching must be"),
    ((None, *RAYS), {"max_bytes": 0}, ValueError, "max_bytes must be from 1"),
    ((None, np.zeros((6, 3)), [0, 0, 1]), {}, TypeError, "origins or directions must be a dask array, got"),
    ((None, da.zeros((6, 2)), RAYS[1]), {}, ValueError, "origins must have shape (..., 3), one vector"),
    ((None, RAYS[0], da.zeros(6)), {}, ValueError, "directions must have shape (..., 3), one vector"),
    ((None, RAYS[0], da.zeros((5, 3))), {}, ValueError, "origins and directions must have one shape, or"),
    ((None, RAYS[0], np.zeros((5, 3))), {}, ValueError, "origins and directions must have one shape, or"),
    ((None, da.zeros((6, 3), dtype=bool), RAYS[1]), {}, TypeError, "origins must be an (n, 3) array of real"),
    ((None, RAYS[0], ["a", "b", "c"]), {}, TypeError, "directions must be an array of real numbers"),
    ((None, *RAYS, da.zeros(5)), {}, ValueError, "tmin must be one number or have shape (6,)"),
    ((None, *RAYS, 0, np.zeros((6, 1))), {}, ValueError, "tmax must be one number or have shape (6,)"),
    ((None, *RAYS, 0, da.zeros(6, dtype=bool)), {}, TypeError, "tmax must be a real number or one per ray"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "options", "error", "message"), REFUSED)
def test_bad_input_is_refused_before_anything_is_computed(given, options, error, message, traced):
    scene, *rays = given if len(given) > 1 else (*given, *RAYS)
    scene = scene_of() if scene is None else scene
    queries = ["intersect_all"]
    if "max_bytes" not in options:
        queries.append("count")
    if "max_bytes" not in options and "touching" not in options:
        queries += ["intersect", "occluded"]
    for name in queries:
        with pytest.raises(error, match="^" + re.escape(message)) as caught:
            getattr(wive.dask, name)(scene, *rays, **options)
        assert "\n" not in str(caught.value)
    assert traced == []


def test_hits_that_do_not_fit_are_a_memory_error():
    scene = scene_of()
    rays = in_chunks(ORIGINS), in_chunks(DIRECTIONS)
    with pytest.raises(MemoryError, match="max_bytes"):
        wive.dask.intersect_all(scene, *rays, max_bytes=10).t.compute()
    with pytest.raises(ValueError, match=r"^directions must have shape \(600, 3\), one per hit, or \(3,\)"):
        wive.dask.intersect(scene, *rays).spawn(da.zeros((5, 3)))


@pytest.mark.parametrize(
    ("shading", "exposure"),
    [("auto", "auto"), ("path", 1.5), ("ao", "auto"), ("headlight", 0), ("normals", 0), ("depth", 0)],
)
def test_a_picture_in_tiles_is_that_of_render(shading, exposure):
    scene = scene_of()
    how = {"shading": shading, "width": 24, "height": 19, "spp": 3, "sky": "cloudy", "exposure": exposure}
    if shading != "auto":
        how |= {"camera": wive.Camera.framing(scene.bounds), "albedo": (0.5, 0.7, 0.2)}
    picture = wive.dask.render(scene, rows=5, **how)
    assert picture.chunks[0] == (5, 5, 5, 4)
    same(picture, wive.render(scene, **how))


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"rows": 0}, ValueError, "rows must be from 1"),
        ({"rows": 1.5}, TypeError, "rows must be an integer"),
        ({"progress": True}, TypeError, "render() got an unexpected keyword argument 'progress'"),
        ({"camera": "here"}, TypeError, "camera must be a wive.Camera or wive.PinholeCamera, or None"),
        ({"threads": 0}, ValueError, "threads must be from 1"),
        ({"exposure": "bright"}, ValueError, "exposure must be a number of stops or 'auto'"),
    ],
)
def test_bad_pictures_are_refused_before_anything_is_computed(options, error, message):
    with pytest.raises(error, match="^" + re.escape(message)):
        wive.dask.render(scene_of(), **options)
    with pytest.raises(TypeError, match=r"^scene must be a wive\.Scene, got int"):
        wive.dask.render(3)


def test_scenes_on_a_warp_device_trace_there(device, traced):
    scene = scene_of(device=device)
    expected = scene.intersect(ORIGINS, DIRECTIONS)
    hits = wive.dask.intersect(scene, in_chunks(ORIGINS, (300, 3)), in_chunks(DIRECTIONS, (300, 3)))
    traced.clear()
    same(hits.t, expected.t)
    assert [options["threads"] for options in traced] == [None, None]
    same(hits.points(), expected.points())
    assert hits.compute().mask.sum() == expected.mask.sum()
    with pytest.raises(ValueError, match=r"^threads is only for CPU backends"):
        wive.dask.count(scene, *RAYS, threads=1)
    again = pickle.loads(pickle.dumps(carried(scene)[0]))
    assert again.scene.device == device


def test_arrays_of_dasks_experiment_are_refused(tmp_path):
    finished = subprocess.run(
        [sys.executable, "-c", "import wive.dask"],
        env={**os.environ, "DASK_ARRAY__QUERY_PLANNING": "True"},
        cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert finished.stderr.splitlines()[-1].startswith(
        "ImportError: wive.dask needs dask's usual arrays, got"
    )
