"""`progress=` of every long call: what is told, in what order, and what an exception of it does."""

import threading
from functools import partial

import numpy as np
import pytest
from support.meshes import random_rays, sphere

import wive
from wive._internal import progress


class Stop(Exception):
    """What the tests end a call with."""


SPHERE = sphere(5)
SCENE = wive.Scene(*SPHERE)
RAYS = random_rays(100_000, seed=1)
POINTS = RAYS[0]

# Each with the number that it counts to.
CALLS = {
    "build": (lambda **how: wive.Scene(*SPHERE, **how), len(SPHERE[1])),
    "build high": (lambda **how: wive.Scene(*SPHERE, quality="high", **how), len(SPHERE[1])),
    "build compressed": (lambda **how: wive.Scene(*SPHERE, nodes="compressed", **how), len(SPHERE[1])),
    "build float64": (lambda **how: wive.Scene(*SPHERE, dtype=np.float64, **how), len(SPHERE[1])),
    "from_meshes": (lambda **how: wive.Scene.from_meshes([SPHERE, SPHERE], **how), 2 * len(SPHERE[1])),
    "refit": (partial(SCENE.refit, SPHERE[0]), len(SPHERE[1])),
    "intersect": (partial(SCENE.intersect, *RAYS), 100_000),
    "intersect threads": (partial(SCENE.intersect, *RAYS, threads=1, in_flight=1), 100_000),
    "intersect shaped": (partial(SCENE.intersect, RAYS[0][0], RAYS[1].reshape(100, 1000, 3)), 100_000),
    "occluded": (partial(SCENE.occluded, *RAYS), 100_000),
    "count": (partial(SCENE.count, *RAYS), 100_000),
    "intersect_all": (partial(SCENE.intersect_all, *RAYS), 100_000),
    "closest": (partial(SCENE.closest, POINTS), 100_000),
    "contains": (partial(SCENE.contains, POINTS), 100_000),
    "contains winding": (partial(SCENE.contains, POINTS, sign="winding"), 100_000),
    "signed_distance": (partial(SCENE.signed_distance, POINTS), 100_000),
    "visible": (partial(SCENE.visible, POINTS, POINTS[0]), 100_000),
    "render": (partial(wive.render, SCENE, width=64, height=48, spp=4), 48),
    "render ao": (partial(wive.render, SCENE, width=64, height=48, spp=4, shading="ao"), 48),
    "stream": (lambda **how: list(wive.stream(SCENE, RAYS, piece=9000, **how)), 100_000),
}


def bits(answer: object) -> list[bytes]:
    if isinstance(answer, list):
        return [part for _, hits in answer for part in bits(hits)]
    names = [name for name in ("t", "prim", "uv", "offsets", "distance") if hasattr(answer, name)]
    if names:
        return [np.asarray(getattr(answer, name)).tobytes() for name in names]
    return [] if answer is None or isinstance(answer, wive.Scene) else [np.asarray(answer).tobytes()]


@pytest.mark.parametrize("name", CALLS)
def test_progress_rises_to_its_total_and_changes_no_bit(name):
    call, total = CALLS[name]
    told, threads = [], set()

    def hear(done, of):
        assert type(done) is int and of == total
        told.append(done)
        threads.add(threading.get_ident())

    assert bits(call(progress=hear)) == bits(call())
    assert told == sorted(told) and told[0] >= 0
    assert told[-1] == total and told.count(total) == 1
    assert threads == {threading.get_ident()}


@pytest.mark.parametrize("name", CALLS)
def test_an_exception_of_progress_ends_the_call_and_all_is_usable_after(name, monkeypatch):
    """At the latest at the end: calls of a tenth of a second may tell nothing before."""
    monkeypatch.setattr(progress, "PERIOD", 0)

    def stop(done, total):
        raise Stop

    with pytest.raises(Stop):
        CALLS[name][0](progress=stop)
    bits(CALLS[name][0]())


def long_calls():
    """Calls that take over a second or so on one core, of a scene in whose box rays go many ways."""
    random = np.random.default_rng(1)
    corners = random.random((200_000, 1, 3)) + random.normal(0, 0.1, (200_000, 3, 3))
    vertices, faces = corners.reshape(-1, 3).astype(np.float32), np.arange(600_000).reshape(-1, 3)
    return vertices, faces, random_rays(15_000, seed=2, low=0, high=1)


def test_long_calls_tell_many_times_in_any_thread_and_end_in_mid_work():
    vertices, faces, rays = long_calls()
    told: dict[str, list[int]] = {}

    def work():
        def hear(name, done, total):
            told.setdefault(name, []).append(done)

        scene = wive.Scene(vertices, faces, quality="high", progress=partial(hear, "build"))
        scene.intersect_all(*rays, threads=1, progress=partial(hear, "all"))

        def stop(done, total):
            told.setdefault("stopped", []).append(done)
            raise Stop

        with pytest.raises(Stop):
            scene.intersect_all(*rays, threads=1, progress=stop)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert told["build"] == sorted(told["build"]) and told["build"][-1] == 200_000
    assert any(0 < done < 15_000 for done in told["all"])
    assert told["stopped"][0] < 15_000


def test_progress_may_query_the_scene_itself():
    vertices, faces, rays = long_calls()
    scene = wive.Scene(vertices, faces)
    inner, outer = [], []

    def hear(done, total):
        outer.append(done)
        scene.contains(rays[0][:100], progress=lambda done, total: inner.append((done, total)))
        scene.intersect(*(array[:5] for array in rays))

    scene.intersect_all(*rays, threads=1, progress=hear)
    assert outer == sorted(outer) and outer[-1] == 15_000
    assert len(outer) > 1 and inner.count((100, 100)) == len(outer)


@pytest.mark.parametrize("count", [0, 1])
def test_no_rays_and_one_ray_tell_the_end(count):
    told = []
    SCENE.intersect(*(array[:count] for array in RAYS), progress=lambda *done: told.append(done))
    assert told == [(count, count)]


def test_no_rays_of_a_shared_direction_are_none():
    told = []
    SCENE.intersect(np.zeros((0, 3)), [0, 0, 1], progress=lambda done, total: told.append((done, total)))
    assert told == [(0, 0)]


@pytest.mark.parametrize("name", ["scene.wive", "scene.npz"])
def test_saving_and_loading_tell_how_far_they_are(tmp_path, name):
    told: list[tuple[int, int]] = []

    def hear(done, total):
        told.append((done, total))

    SCENE.save(tmp_path / name, progress=hear)
    assert name.endswith(".npz") or told[-1][0] == told[-1][1] > 0
    for load in (wive.load, wive.Scene.from_file):
        assert len(load(tmp_path / name, progress=hear)) == len(SCENE)
    ends = [pair for pair in told if pair[0] == pair[1]]  # before these, a slow machine tells more
    assert name.endswith(".wive") or ends == 2 * [(len(SCENE), len(SCENE))]


def test_a_save_that_is_stopped_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.setattr(progress, "PERIOD", 0)

    def stop(done, total):
        raise Stop

    with pytest.raises(Stop):
        SCENE.save(tmp_path / "scene.wive", progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_a_saved_tree_is_used_when_progress_is_asked_for(tmp_path):
    SCENE.save(tmp_path / "scene.wive")
    assert wive.Scene.from_file(tmp_path / "scene.wive", progress=True)._bvh.source is not None


@pytest.mark.parametrize("value", [3, "yes", np.zeros(2)])
@pytest.mark.parametrize("name", [name for name in CALLS if " " not in name])
def test_other_values_are_refused(name, value):
    with pytest.raises(TypeError, match=r"^progress must be True, False, None or a callable"):
        CALLS[name][0](progress=value)


def test_true_shows_a_bar_on_stderr(capfd):
    pytest.importorskip("tqdm")
    SCENE.intersect(*RAYS, progress=True)
    error = capfd.readouterr().err
    assert "tracing: 100%" in error and "100k/100k" in error
    SCENE.intersect(*RAYS, progress=False)
    assert capfd.readouterr().err == ""
