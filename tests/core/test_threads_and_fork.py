"""Results depend on the rays alone, in threads and in forked processes."""

import multiprocessing
import os
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from support.meshes import random_rays, soup, sphere

import wive
from wive import _cpu


def answers(scene: wive.Scene, rays: tuple[np.ndarray, np.ndarray], **options) -> list[np.ndarray]:
    hits = scene.intersect(*rays, **options)
    return [hits.t, hits.prim, hits.uv, scene.occluded(*rays, **options)]


def threads_of(scene: wive.Scene, count: int) -> dict[str, int]:
    """The option `threads`, if the scene's backend has it."""
    return {} if scene.backend == "warp" else {"threads": count}


def assert_same(one: list[np.ndarray], other: list[np.ndarray]) -> None:
    for left, right in zip(one, other, strict=True):
        np.testing.assert_array_equal(left, right)


@pytest.fixture
def scene(backend) -> wive.Scene:
    return wive.Scene(*soup(3000, seed=1, size=0.05), backend=backend)


def test_threads_and_rays_in_flight_change_no_bit(scene):
    rays = random_rays(20_011, seed=2, low=0, high=1)
    if scene.backend == "warp":
        pytest.skip("these options are for CPU backends")
    one_by_one = answers(scene, rays, threads=1, in_flight=1)
    for options in (
        {},
        {"threads": 7},
        {"threads": 100_000},
        {"in_flight": 5},
        {"threads": 3, "in_flight": 64},
    ):
        assert_same(answers(scene, rays, **options), one_by_one)


def test_splitting_a_batch_changes_no_bit(scene):
    origins, directions = random_rays(1003, seed=3, low=0, high=1)
    whole = answers(scene, (origins, directions))
    for size in (1, 7, 64, 1000):
        parts = [
            answers(scene, (origins[first : first + size], directions[first : first + size]))
            for first in range(0, len(origins), size)
        ]
        assert_same([np.concatenate(arrays) for arrays in zip(*parts, strict=True)], whole)


def test_threads_may_share_a_scene(scene):
    rays = random_rays(5000, seed=4, low=0, high=1)
    expected = answers(scene, rays)
    found: list[list[np.ndarray]] = []
    workers = [threading.Thread(target=lambda: found.append(answers(scene, rays))) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(found) == 4
    for answer in found:
        assert_same(answer, expected)


@pytest.mark.timeout(60)
def test_a_forked_child_traces_as_its_parent_did(scene):
    rays = random_rays(20_000, seed=5, low=0, high=1)
    expected = answers(scene, rays, **threads_of(scene, 4))
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)

    def trace_and_build() -> None:
        rebuilt = wive.Scene(scene.vertices, scene.faces, backend=scene.backend)
        sender.send(
            [answers(scene, rays, **threads_of(scene, 4)), answers(rebuilt, rays, **threads_of(scene, 4))]
        )

    child = context.Process(target=trace_and_build)
    with warnings.catch_warnings():
        # Python warns of any fork while other threads run.
        warnings.simplefilter("ignore", DeprecationWarning)
        child.start()
    try:
        assert receiver.poll(30), "the forked child hangs"
        for answer in receiver.recv():
            assert_same(answer, expected)
        child.join(10)
        assert child.exitcode == 0
    finally:
        child.kill()
        child.join()
    assert_same(answers(scene, rays, **threads_of(scene, 4)), expected)


def trace(scene: wive.Scene) -> None:
    scene.intersect(*random_rays(1_000_000, seed=6), threads=1)


def draw(scene: wive.Scene) -> None:
    camera = wive.Camera(eye=(0, 0, 4), target=(0, 0, 0))
    wive.render(scene, camera, shading="path", width=512, height=512, spp=2, threads=1)


@pytest.mark.parametrize("work", [trace, draw])
def test_other_python_threads_run_while_rays_are_traced(monkeypatch, work):
    """Each call into the core is timed; a counting thread must advance during it."""
    scene = wive.Scene(*sphere(6))
    monkeypatch.setattr(wive.rendering, "BAND_PATHS", 10**9)
    ticks, stop = [0], threading.Event()

    def count() -> None:
        while not stop.is_set():
            ticks[0] += 1
            time.sleep(0.0005)

    class Watched:
        def __getattr__(self, name):
            method = getattr(bvh, name)
            if not callable(method):
                return method

            def call(*arguments, **keywords):
                ticks_before, begin = ticks[0], time.perf_counter()
                result = method(*arguments, **keywords)
                seen.append((ticks[0] - ticks_before, time.perf_counter() - begin))
                return result

            return call

    bvh, seen = scene._bvh, []
    monkeypatch.setattr(scene._tracer, "bvh", Watched())
    monkeypatch.setattr(wive.Scene, "bounds", property(lambda self: bvh.bounds))
    counter = threading.Thread(target=count)
    counter.start()
    try:
        work(scene)
    finally:
        stop.set()
        counter.join()
    ((ticked, seconds),) = seen
    assert seconds > 0.02
    assert ticked >= 5


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="counts threads by Linux's /proc")
def test_only_a_mesh_that_is_worth_it_starts_threads():
    def most_threads(triangles: int) -> int:
        """The most threads at a time that this process was seen to have more than before."""
        mesh = soup(triangles, seed=8)
        seen, done = [0], threading.Event()

        def watch() -> None:
            while not done.is_set():
                seen.append(len(os.listdir("/proc/self/task")))

        watcher = threading.Thread(target=watch)
        watcher.start()
        before = len(os.listdir("/proc/self/task"))
        try:
            end = time.monotonic() + 0.5
            while time.monotonic() < end:
                _cpu.Bvh(*mesh, threads=4)
        finally:
            done.set()
            watcher.join()
        return max(seen) - before

    assert most_threads(12) == 0
    assert most_threads(2000) == 0
    assert most_threads(100_000) == 3
