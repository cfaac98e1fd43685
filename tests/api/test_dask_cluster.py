"""wive.dask on a cluster of two processes: one tree in each, all hits right even if one is killed."""

import os
import signal
import time
from collections.abc import Iterator

import numpy as np
import pytest
from support.meshes import random_rays, soup

import wive
from wive import _cpu

dask = pytest.importorskip("dask")
da = pytest.importorskip("dask.array")
distributed = pytest.importorskip("distributed")

import wive.dask  # noqa: E402

CHUNK, CHUNKS = 500, 20
ORIGINS, DIRECTIONS = random_rays(CHUNK * CHUNKS, seed=6)
RAYS = da.from_array(ORIGINS, chunks=(CHUNK, 3)), da.from_array(DIRECTIONS, chunks=(CHUNK, 3))


@pytest.fixture(scope="module")
def client(tmp_path_factory) -> Iterator["distributed.Client"]:
    """Of two processes that run one task at a time each, and count the trees that they build."""
    local = tmp_path_factory.mktemp("dask")
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "dashboard_address": None,
        "local_directory": str(local),
    }
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "120s"}),  # machines that run tests are busy
        distributed.LocalCluster(**options) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(count_trees)
        yield client


def count_trees() -> None:
    """Note the threads of each build in `_cpu.built`."""
    build = _cpu.Bvh
    _cpu.built = []

    def built(*args, **options):
        _cpu.built.append(_cpu.thread_count())
        return build(*args, **options)

    _cpu.Bvh = built


def trees_built() -> list[int]:
    found = _cpu.built[:]
    del _cpu.built[:]
    return found


@pytest.mark.parametrize("kept", ["mesh", "file"])
def test_twenty_chunks_take_one_tree_per_process(client, kept, tmp_path):
    scene = wive.Scene(*soup(2000, seed=7))
    if kept == "file":
        scene.save(tmp_path / "scene")
        scene = wive.load(tmp_path / "scene")
    expected, every = scene.intersect(ORIGINS, DIRECTIONS), scene.intersect_all(ORIGINS, DIRECTIONS)
    hits = wive.dask.intersect(scene, *RAYS)
    t, prim, normals = dask.compute(hits.t, hits.prim, hits.normals())
    np.testing.assert_array_equal(t, expected.t)
    np.testing.assert_array_equal(prim, expected.prim)
    np.testing.assert_array_equal(normals, expected.normals())
    counts, all_hits = dask.compute(wive.dask.count(scene, *RAYS), wive.dask.intersect_all(scene, *RAYS))
    np.testing.assert_array_equal(counts, every.counts)
    np.testing.assert_array_equal(all_hits.t, every.t)
    np.testing.assert_array_equal(all_hits.points(), every.points())
    built = list(client.run(trees_built).values())
    assert len(built) == 2
    if kept == "mesh":  # on one thread, as workers of one thread have no more
        assert [1] in built and all(one in ([1], []) for one in built)
    else:
        assert built == [[], []]


FREE_CHUNKS = 2


def gated(rays: np.ndarray, gate: str) -> np.ndarray:
    """The rays; after some chunks each process waits until there is a file of that name."""
    _cpu.chunks_run = getattr(_cpu, "chunks_run", 0) + 1
    while _cpu.chunks_run > FREE_CHUNKS and not os.path.exists(gate):
        time.sleep(0.01)
    return rays


def test_a_worker_killed_in_mid_run_costs_no_hit(client, tmp_path):
    scene = wive.Scene(*soup(2000, seed=8))
    expected = scene.intersect(ORIGINS, DIRECTIONS)
    origins = RAYS[0].map_blocks(gated, str(tmp_path / "gate"), meta=ORIGINS[:0])
    kept = wive.dask.intersect(scene, origins, RAYS[1]).persist()
    futures = distributed.futures_of(kept)
    done, waiting = distributed.wait(futures, return_when="FIRST_COMPLETED")
    assert len(futures) == CHUNKS and len(waiting) >= CHUNKS - 2 * FREE_CHUNKS
    pids = client.run(os.getpid)
    (holder, *_), *_ = client.who_has(done).values()
    os.kill(pids[holder], signal.SIGKILL)
    (tmp_path / "gate").touch()
    np.testing.assert_array_equal(kept.t.compute(), expected.t)
    np.testing.assert_array_equal(kept.points().compute(), expected.points())
    whole = kept.compute()
    np.testing.assert_array_equal(whole.prim, expected.prim)
    np.testing.assert_array_equal(whole.spawn(DIRECTIONS), expected.spawn(DIRECTIONS))
