"""Ctrl-C and other signals are handled while the core works, and everything can be used afterwards."""

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest
from support.meshes import soup

import wive
from wive._internal.helper_thread import HelperThread

if not hasattr(signal, "setitimer"):
    pytest.skip("the system has no interval timers", allow_module_level=True)

SIDE = 300  # squares along a side of a flat grid


class Interrupted(Exception):
    """Raised by the handler of a signal."""


@contextmanager
def every(seconds: float, handler: Callable[[], None]) -> Iterator[None]:
    """Handle a signal that comes again and again."""
    before = signal.signal(signal.SIGALRM, lambda *_: handler())
    signal.setitimer(signal.ITIMER_REAL, seconds, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def slow() -> tuple[wive.Scene, np.ndarray, np.ndarray]:
    """Rays that lie in a floor, of which each takes tens of microseconds."""
    axis = np.arange(SIDE + 1.0)
    vertices = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.zeros((SIDE + 1, SIDE + 1))], axis=-1)
    corner = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).ravel()
    steps = np.array([[0, SIDE + 1, SIDE + 2], [0, SIDE + 2, 1]])
    scene = wive.Scene(
        vertices.reshape(-1, 3), (corner[:, None, None] + steps).reshape(-1, 3), dtype="float32"
    )
    random = np.random.default_rng(9)
    origins = np.c_[random.random((200_000, 2)) * SIDE, np.zeros(200_000)].astype(np.float32)
    angles = random.random(200_000) * 2 * np.pi
    return scene, origins, np.c_[np.cos(angles), np.sin(angles), 0 * angles].astype(np.float32)


@pytest.fixture(scope="module")
def calls(slow: tuple[wive.Scene, np.ndarray, np.ndarray]) -> dict[str, Callable[[], object]]:
    scene, origins, directions = slow
    vertices, faces = soup(1_000_000, seed=10, size=0.005)
    return {
        "intersect": partial(scene.intersect, origins, directions, threads=1),
        "occluded": partial(scene.occluded, origins, directions, threads=1),
        "intersect_all": partial(scene.intersect_all, origins, directions),
        "closest": partial(scene.closest, np.tile(origins + np.float32([0, 0, 50]), (5, 1))),
        "Scene": partial(wive.Scene, vertices, faces, quality="high"),
        "first winding number": partial(wive.Scene(vertices, faces).contains, vertices[:1], sign="winding"),
    }


@pytest.mark.parametrize("name", ["intersect", "Scene", "first winding number"])
def test_signals_are_handled_meanwhile(calls: dict[str, Callable[[], object]], name: str) -> None:
    """Without that, one call takes any number of signals for one, after its end."""
    ticks: list[int] = []
    with every(0.02, lambda: ticks.append(1)):
        calls[name]()
    assert len(ticks) > 1


@pytest.mark.parametrize("name", ["intersect", "occluded", "intersect_all", "closest", "Scene"])
def test_what_a_handler_raises_ends_the_call(
    calls: dict[str, Callable[[], object]], slow: tuple[wive.Scene, np.ndarray, np.ndarray], name: str
) -> None:
    stopped: list[bool] = []

    def stop() -> None:
        if not stopped:  # the second signal may come when the call has ended
            stopped.append(True)
            raise Interrupted

    scene = slow[0]
    down = np.array([[10.25, 20.5, 1.0]]), np.array([[0.0, 0, -1]])
    before = scene.intersect(*down).prim
    with pytest.raises(Interrupted), every(0.05, stop):
        calls[name]()
    assert scene.intersect(*down).prim == before


def test_files_stay_open_until_their_thread_has_ended() -> None:
    """However often Ctrl-C is pressed: a closed file's number may be another file's."""
    done: list[int] = []

    def work() -> None:
        time.sleep(0.3)
        done.append(1)

    def stop() -> None:
        raise Interrupted

    with pytest.raises(Interrupted), every(0.05, stop):
        try:
            with HelperThread() as helper:
                helper.submit(work)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            assert done


def test_what_a_helper_raises_reaches_who_asks_and_the_next_task_runs() -> None:
    def fail() -> None:
        raise Interrupted

    with HelperThread() as helper:
        tasks = helper.submit(fail), helper.submit(lambda: 3)
        for _ in range(2):
            with pytest.raises(Interrupted):
                tasks[0].result()
            assert tasks[1].result() == 3
    helper.end()  # nothing is left to wait for
