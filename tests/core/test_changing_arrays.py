"""Whatever another thread writes to the caller's arrays, the core reads and writes within bounds.

Each case runs in a process of its own, because a fault may end it. What is computed meanwhile is not defined;
a refused mesh is an answer as good as any.
"""

import subprocess
import sys
from pathlib import Path

import pytest

SETUP = """
import contextlib, threading, time
import numpy as np
import wive
from wive import _cpu

random = np.random.default_rng(1)
n = 6000
vertices = (random.random((n, 1, 3)) + 0.05 * random.random((n, 3, 3))).reshape(-1, 3)
faces = np.arange(3 * n, dtype=np.int32).reshape(-1, 3) // 2
ending = False

def spoil(array, good):
    '''Alternates between what is right and what no check would let pass.'''
    k = 0
    while not ending:
        k += 1
        rows = random.integers(0, len(array), 200)
        if k % 3:
            array[rows] = good[rows]
        elif array.dtype.kind == 'i':
            array[rows] = random.integers(-2**31, 2**31, (200, 3))
        else:
            array[rows] = random.choice([np.nan, np.inf, -np.inf, 3e38, -1e30, 1e-45], (200, 3))

def meanwhile(work, *spoiled, seconds=0.5):
    global ending
    ending = False
    threads = [threading.Thread(target=spoil, args=pair) for pair in spoiled]
    for thread in threads: thread.start()
    end, done = time.monotonic() + seconds, 0
    try:
        while time.monotonic() < end:
            with contextlib.suppress(ValueError):
                work()
                done += 1
    finally:
        ending = True
        for thread in threads: thread.join()
    for array, good in spoiled: array[:] = good
"""

CASES = {
    "built": """
for dtype in (np.float32, np.float64):
    v, f = vertices.astype(dtype), faces.copy()
    for nodes in ("float32", "compressed"):
        for quality in ("medium", "high"):
            meanwhile(lambda: _cpu.Bvh(v, f, nodes=nodes, quality=quality), (v, v.copy()), (f, f.copy()),
                      seconds=0.3)
""",
    "built exactly": """
v, f = vertices.astype(np.float32), faces.copy()
def work():
    scene = wive.Scene(v, f, accuracy="exact")
    scene.count(v[:300].copy(), np.ones((300, 3), np.float32), -np.inf)
meanwhile(work, (v, v.copy()), (f, f.copy()))
""",
    "refitted": """
for dtype in (np.float32, np.float64):
    for nodes in ("float32", "compressed"):
        v, f = vertices.astype(dtype), faces.copy()
        bvh = _cpu.Bvh(v.copy(), f, nodes=nodes)
        meanwhile(lambda: bvh.refitted(v), (v, v.copy()), (f, f.copy()), seconds=0.4)
""",
    "queried": """
for dtype, accuracy in ((np.float32, "watertight"), (np.float32, "exact"), (np.float64, "watertight")):
    for nodes in ("float32", "compressed"):
        scene = wive.Scene(vertices.astype(dtype), faces.copy(), accuracy=accuracy, nodes=nodes)
        o, d = random.random((5000, 3)).astype(dtype), random.standard_normal((5000, 3)).astype(dtype)
        low, high = np.zeros(5000, dtype), np.full(5000, np.inf, dtype)
        def work():
            scene.intersect(o, d, low, high); scene.occluded(o, d)
            scene.count(o, d); scene.intersect_all(o, d)
        meanwhile(work, (o, o.copy()), (d, d.copy()), seconds=0.3)
""",
    "shaded": """
for dtype in (np.float32, np.float64):
    v, f = vertices.astype(dtype), faces.copy()
    scene = wive.Scene(v, f)
    o, d = random.random((5000, 3)).astype(dtype), random.standard_normal((5000, 3)).astype(dtype)
    hits = scene.intersect(o, d)
    def work():
        hits.points(); hits.normals(); hits.error_bound; hits.spawn(d)
    meanwhile(work, (v, v.copy()), (f, f.copy()), seconds=0.4)
""",
    "rendered": """
v, f = vertices.astype(np.float32), faces.copy()
scene = wive.Scene(v, f)
camera = wive.Camera((0.5, 0.5, -2), (0.5, 0.5, 0.5))
meanwhile(lambda: wive.render(scene, camera, width=64, height=64, spp=2), (v, v.copy()), (f, f.copy()))
""",
}


def run(code: str, folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, cwd=folder
    )
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize("name", CASES)
def test_a_mesh_whose_arrays_change_never_harms_while(name: str, tmp_path: Path) -> None:
    run(SETUP + CASES[name], tmp_path)


def test_a_compressed_scene_is_built_while_its_vertices_move(tmp_path: Path) -> None:
    """Vertices are equal at one moment and differ at the next: blocks take the memory that was planned."""
    code = (
        SETUP
        + """
v, f = vertices.astype(np.float32), faces.copy()
still = v.copy()
def move():
    k = 0
    while not ending:
        k += 1
        np.multiply(still, np.float32(k % 2), out=v)
thread = threading.Thread(target=move)
thread.start()
for _ in range(60): _cpu.Bvh(v, f, nodes="compressed")
ending = True
thread.join()
"""
    )
    run(code, tmp_path)
