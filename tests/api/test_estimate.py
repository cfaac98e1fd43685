"""`wive.estimate` says what a scene will take within 10 %."""

import subprocess
import sys

import numpy as np
import pytest
from support.meshes import soup, sphere

import wive

FORMS = [
    {"dtype": dtype, "nodes": nodes}
    for dtype in (np.float32, np.float64)
    for nodes in ("float32", "compressed")
]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: f"{form['dtype'].__name__}-{form['nodes']}")
def test_the_tree_takes_what_was_estimated(form):
    meshes = [sphere(5), sphere(6), soup(20_000, seed=1, size=0.01), soup(50_000, seed=2, size=0.3)]
    i = np.arange(300, dtype=np.float32)
    heights = wive.Scene.from_heightfield(np.sin(i[:, None] * 0.1) * np.cos(i * 0.07) * 3, i, i)
    meshes.append((heights.vertices, heights.faces))
    for vertices, faces in meshes:
        scene = wive.Scene(vertices, faces, **form)
        estimate = wive.estimate(len(faces), len(vertices), **form)
        assert estimate.tree == pytest.approx(scene.memory, rel=0.1)
        assert estimate.mesh == scene.vertices.nbytes + scene.faces.nbytes


PEAK = """
import re, sys
import numpy as np, wive

def now(name):
    return 1024 * int(re.search(name + r":\\s+(\\d+)", open("/proc/self/status").read())[1])

i = np.arange(801.0)
x, y = np.meshgrid(i, i)
points = np.stack([x, y, 3 * np.sin(0.1 * y) * np.cos(0.07 * x)], axis=-1)
vertices = points.reshape(-1, 3).astype(sys.argv[1])
rows = np.arange(len(vertices), dtype="i4").reshape(x.shape)
a, b, c, d = rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]
faces = np.ascontiguousarray(np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3))
del x, y, points, rows
wive.Scene(vertices[:300], np.arange(300, dtype="i4").reshape(-1, 3))
open("/proc/self/clear_refs", "w").write("5")
before = now("VmRSS")
scene = wive.Scene(vertices, faces, nodes=sys.argv[2], quality=sys.argv[3])
print(now("VmHWM") - before, len(faces), len(vertices))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(
    ("dtype", "nodes", "quality"),
    [
        ("float32", "float32", "medium"),
        ("float32", "float32", "high"),
        ("float32", "compressed", "medium"),
        ("float64", "float32", "medium"),
        ("float64", "compressed", "medium"),
    ],
)
def test_building_takes_what_was_estimated(dtype, nodes, quality, tmp_path):
    ran = subprocess.run(
        [sys.executable, "-c", PEAK, dtype, nodes, quality],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    peak, triangles, vertices = map(int, ran.stdout.split())
    estimate = wive.estimate(triangles, vertices, dtype=dtype, nodes=nodes, quality=quality)
    assert peak == pytest.approx(estimate.building, rel=0.1)


def test_a_closed_mesh_has_half_as_many_vertices_as_triangles():
    vertices, faces = sphere(4)
    assert wive.estimate(len(faces)) == wive.estimate(len(faces), len(vertices))


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_tree_beyond_the_limit_is_refused(dtype, nodes):
    with pytest.raises(ValueError, match=r"^triangles must be at most \d+ in one scene") as error:
        wive.estimate(2**31 - 1, dtype=dtype, nodes=nodes)
    most = int(str(error.value).split()[5])
    assert wive.estimate(most - 100, dtype=dtype, nodes=nodes).tree <= 2**33


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((-1,), {}, "triangles must be from 0 to"),
        ((1.5,), {}, "triangles must be an integer"),
        ((5, -1), {}, "vertices must be from 0 to"),
        ((5,), {"dtype": "int8"}, "dtype must be float32 or float64"),
        ((5,), {"nodes": "small"}, "nodes must be one of float32, compressed"),
        ((5,), {"quality": "best"}, "quality must be one of medium, high"),
    ],
)
def test_what_makes_no_scene_is_refused(arguments, options, message):
    with pytest.raises((ValueError, TypeError), match=message):
        wive.estimate(*arguments, **options)
