"""One tree for many processes: shared scenes pickle as names, hits without their mesh, nothing is left."""

import copy
import gc
import os
import pickle
import re
import signal
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from support.meshes import assert_same_hits, random_rays, soup

import wive
from wive._internal import shared_memory

RAYS = random_rays(300, seed=6)
SHARED = Path("/dev/shm")
pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="shared memory is looked at in /dev/shm")


def scene_of(count=2000, **options) -> wive.Scene:
    return wive.Scene(*soup(count, seed=7), **options)


def shared_names() -> set[str]:
    """Of the memory that Python's processes share; other names are semaphores."""
    gc.collect()
    return {name for name in os.listdir(SHARED) if name.startswith("psm_")}


def holds_shared_tree(scene) -> bool:
    return scene._bvh.source is not None


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_shared_scene_answers_as_before_and_frees_its_memory_when_it_goes(dtype, nodes):
    before = shared_names()
    scene = scene_of(dtype=dtype, nodes=nodes)
    expected = scene.intersect(*RAYS)
    scene.share()
    (name,) = shared_names() - before
    scene.share()  # nothing more
    assert shared_names() - before == {name}
    assert_same_hits(scene.intersect(*RAYS), expected)
    pickled = pickle.dumps(scene)
    assert len(pickled) < 500
    again = pickle.loads(pickled)
    assert again._bvh is scene._bvh
    del scene, again
    assert shared_names() == before
    with pytest.raises(FileNotFoundError, match=re.escape(name) + ": no such shared memory: the process"):
        pickle.loads(pickled)


def test_refit_frees_the_memory_and_hits_keep_the_mesh():
    before = shared_names()
    scene = scene_of()
    scene.share()
    hits = scene.intersect(*RAYS)
    points = hits.points()
    scene.refit(scene.vertices + 1)
    assert not holds_shared_tree(scene)
    assert shared_names() == before
    np.testing.assert_array_equal(hits.points(), points)
    scene.share()
    assert len(shared_names() - before) == 1
    del scene
    assert shared_names() == before


def test_a_loaded_scene_needs_no_shared_memory(tmp_path):
    before = shared_names()
    scene_of().save(tmp_path / "scene")
    scene = wive.load(tmp_path / "scene")
    scene.share()
    assert shared_names() == before


def test_several_meshes_are_shared():
    meshes = [soup(100, seed=seed) for seed in (1, 2)]
    scene = wive.Scene.from_meshes(meshes)
    expected = scene.intersect(*RAYS).geom
    scene.share()
    assert scene.geoms.faces.tolist() == [0, 100, 200]
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(scene)).intersect(*RAYS).geom, expected)


def traced(scene, rays):
    """In a worker: hits, and whether the scene's tree is the shared one."""
    hits = scene.intersect(*rays)
    hits.points()
    return hits, holds_shared_tree(scene), len(pickle.dumps(hits))


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes_share_the_tree_and_send_back_hits_without_the_mesh(method):
    before = shared_names()
    scene = scene_of(20_000)
    expected = scene.intersect(*RAYS)
    scene.share()
    with ProcessPoolExecutor(2, mp_context=get_context(method)) as pool:
        for hits, is_shared, size in pool.map(traced, [scene] * 4, [RAYS] * 4):
            assert is_shared and size < 30_000
            assert hits.vertices is scene.vertices and hits.faces is scene.faces
            assert_same_hits(hits, expected)
            np.testing.assert_array_equal(hits.points(), expected.points())
            np.testing.assert_array_equal(hits.error_bound, expected.error_bound)
    assert_same_hits(scene.intersect(*RAYS), expected)  # the workers' end freed nothing
    del scene, hits
    assert shared_names() == before


OWNER = """
import os, signal, sys, numpy as np, wive
rng = np.random.default_rng(0)
scene = wive.Scene(rng.random((300, 3)), np.arange(300).reshape(-1, 3))
scene.share()
print(scene._bvh.source.place.name, flush=True)
sys.stdin.read(1)
if sys.argv[1] == "kill":
    os.kill(os.getpid(), signal.SIGKILL)
if sys.argv[1] == "raise":
    raise SystemExit(3)
"""


@pytest.mark.parametrize("end", ["return", "raise", "kill"])
def test_memory_goes_when_its_process_ends_and_users_keep_theirs(end, tmp_path):
    with subprocess.Popen(
        [sys.executable, "-c", OWNER, end],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        name = process.stdout.readline().strip()
        assert (SHARED / name).exists()
        user = subprocess.run(  # of a process that is not the owner's child
            [
                sys.executable,
                "-c",
                f"from wive._internal.stored_scenes import open_shared as o; o('{name}').verify()",
            ],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert (user.returncode, user.stderr) == (0, "")
        assert (SHARED / name).exists()
        process.stdin.write("x")
        process.stdin.close()
        process.stdin = None
        _, errors = process.communicate(timeout=60)  # the resource tracker has the pipe until it has ended
    assert process.returncode == {"return": 0, "raise": 3, "kill": -signal.SIGKILL}[end]
    assert not (SHARED / name).exists()
    if end != "kill":
        assert errors == ""


def test_a_forked_process_that_lets_go_frees_nothing():
    scene = scene_of()
    scene.share()
    name = scene._bvh.source.place.name
    child = os.fork()
    if child == 0:
        del scene
        gc.collect()
        os._exit(0)
    os.waitpid(child, 0)
    assert (SHARED / name).exists()


def test_shared_memory_that_is_too_small_is_a_memory_error(monkeypatch):
    before = shared_names()

    def refuse(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shared_memory.os, "posix_fallocate", refuse)
    scene = scene_of()
    with pytest.raises(MemoryError, match=r"^not enough shared memory for [0-9,]+ bytes .*/dev/shm"):
        scene.share()
    assert shared_names() == before
    assert len(scene.intersect(*RAYS)) == 300


def test_other_shared_memory_is_no_scene():
    from multiprocessing.shared_memory import SharedMemory

    from wive._internal.stored_scenes import open_shared

    other = SharedMemory(create=True, size=5000)
    try:
        with pytest.raises(ValueError, match="not a scene saved by wive"):
            open_shared(other.name)
    finally:
        other.close()
        other.unlink()


@pytest.mark.parametrize("query", ["intersect", "intersect_all"])
def test_pickled_hits_hold_no_mesh_and_find_that_of_this_process(query):
    scene = scene_of(50_000)
    hits = getattr(scene, query)(*RAYS)
    size = sum(getattr(hits, name).nbytes for name in ("t", "prim", "uv")) + sum(rays.nbytes for rays in RAYS)
    pickled = pickle.dumps(hits)
    assert len(pickled) < size + 8 * len(RAYS[0]) + 2000
    again = pickle.loads(pickled)
    assert again.vertices is scene.vertices
    np.testing.assert_array_equal(again.points(), hits.points())
    del scene
    again = pickle.loads(pickled)  # other hits hold the mesh
    np.testing.assert_array_equal(again.normals(), hits.normals())


HITS_ALONE = """
import pickle
hits = pickle.load(open("hits", "rb"))
assert hits.mask.any() and hits.uv.shape[-1] == 2 and len(hits.geom) == len(hits.t)
try:
    hits.points()
except ValueError as error:
    print(error)
scene = pickle.load(open("scene", "rb"))
print(abs(hits.with_mesh(scene).points()[hits.mask]).sum(), abs(hits.points()[hits.mask]).sum())
"""


@pytest.mark.parametrize("shape", [(300, 3), (20, 15, 3)])
def test_hits_in_a_process_without_their_mesh_say_so_and_take_one(tmp_path, shape):
    scene = scene_of()
    hits = scene.intersect(*(rays.reshape(shape) for rays in RAYS))
    (tmp_path / "hits").write_bytes(pickle.dumps(hits))
    (tmp_path / "scene").write_bytes(pickle.dumps(scene))
    ran = subprocess.run([sys.executable, "-c", HITS_ALONE], cwd=tmp_path, capture_output=True, text=True)
    told, sums = ran.stdout.splitlines()
    assert "with_mesh(scene)" in told and "share or save" in told, ran.stderr
    assert set(sums.split()) == {str(abs(hits.points()[hits.mask]).sum())}


def test_a_mesh_of_other_size_is_refused():
    hits = scene_of().intersect(*RAYS)
    with pytest.raises(ValueError, match=r"^scene must be the one that was hit, of 6000 float32 vertices"):
        pickle.loads(pickle.dumps(hits)).with_mesh(scene_of(10))
    other = scene_of()
    assert hits.with_mesh(other).vertices is other.vertices


def test_a_loaded_scenes_hits_find_the_file_again(tmp_path):
    path = tmp_path / "scene"
    scene_of().save(path)
    hits = wive.load(path).intersect(*RAYS)
    points, pickled = hits.points(), pickle.dumps(hits)
    del hits
    gc.collect()
    np.testing.assert_array_equal(pickle.loads(pickled).points(), points)
    gc.collect()
    path.unlink()
    again = pickle.loads(pickled)
    assert again.mask.any()
    with pytest.raises(FileNotFoundError, match=re.escape(str(path))):
        again.points()


def test_hits_made_by_hand_keep_their_mesh():
    vertices, faces = soup(4, seed=1)
    hits = wive.Hits(np.zeros(1, "f4"), np.zeros(1, "i4"), np.zeros((1, 2), "f4"), vertices, faces)
    again = pickle.loads(pickle.dumps(hits))
    np.testing.assert_array_equal(again.vertices, vertices)


def test_copies_of_scenes_are_apart():
    scene = scene_of()
    expected = scene.intersect(*RAYS)
    for one in (copy.copy(scene), copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        assert_same_hits(one.intersect(*RAYS), expected)
        one.refit(scene.vertices + 2)
    assert_same_hits(scene.intersect(*RAYS), expected)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(expected)).points(), expected.points())


USER = """
import sys, wive, numpy as np
def pss():
    lines = open("/proc/self/smaps_rollup").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
rays = np.zeros((1000, 3), "f4"), np.random.default_rng(0).normal(size=(1000, 3)).astype("f4")
wive.Scene(np.eye(3), [[0, 1, 2]]).intersect(*rays)
before = pss()
scene = wive.load("scene")
scene.intersect(*rays)
print(flush=True)
sys.stdin.readline()
print(pss() - before, flush=True)
sys.stdin.readline()
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="reads /proc/self/smaps_rollup")
def test_four_processes_on_one_file_take_the_memory_of_one(tmp_path):
    scene_of(1_000_000).save(tmp_path / "scene")

    def memory_of(count: int) -> int:
        """KiB that this many processes add by the scene, each page shared out among its users."""
        users = [
            subprocess.Popen(
                [sys.executable, "-c", USER],
                cwd=tmp_path,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for _ in range(count)
        ]
        for user in users:
            user.stdout.readline()
        sizes = []
        for user in users:
            user.stdin.write("\n")
            user.stdin.flush()
            sizes.append(int(user.stdout.readline()))
        for user in users:
            user.communicate("\n")
        return sum(sizes)

    assert memory_of(4) < 1.1 * memory_of(1)


def test_a_copy_that_went_gives_its_name_to_no_other_mesh():
    """Arrays that are freed leave their addresses to new ones."""
    scene = scene_of()
    for seed in range(10):
        copied = pickle.loads(pickle.dumps(scene))
        gc.collect()
        del copied
        other = wive.Scene(*soup(2000, seed=seed))
        hits = other.intersect(*RAYS)
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(hits)).points(), hits.points())


def test_hits_find_a_copy_of_the_scene_that_went():
    scene = scene_of()
    hits = scene.intersect(*RAYS)
    copied, pickled, points = pickle.loads(pickle.dumps(scene)), pickle.dumps(hits), hits.points()
    del scene, hits
    gc.collect()
    np.testing.assert_array_equal(pickle.loads(pickled).points(), points)
    assert len(copied) == 2000
