"""While wive is installed in trimesh, every mesh uses it, and none is left changed afterwards."""

import copy
import io
import pickle
import pickletools
import subprocess
import sys

import numpy as np
import pytest
from support.meshes import sphere

import wive
from wive.trimesh import RayMeshIntersector, install, installed, uninstall

trimesh = pytest.importorskip("trimesh")

pytestmark = pytest.mark.timeout(120)


@pytest.fixture(autouse=True)
def nothing_stays_installed():
    yield
    uninstall()


class Casing(trimesh.Trimesh):
    """A user's own class of meshes."""


def ball():
    return trimesh.Trimesh(*sphere(2), process=False)


def loaded(kind):
    data = io.BytesIO(
        ball().export(file_type=kind).encode() if kind == "obj" else ball().export(file_type=kind)
    )
    return trimesh.load(data, file_type=kind, force="mesh")


MESHES = {
    "made": ball,
    "made without embree": lambda: trimesh.Trimesh(*sphere(2), use_embree=False),
    "of a subclass": lambda: Casing(*sphere(2)),
    "created": lambda: trimesh.creation.icosphere(),
    "primitive": lambda: trimesh.primitives.Sphere(),
    "copy": lambda: ball().copy(),
    "copy with its cache": lambda: ball().copy(include_cache=True),
    "shallow copy": lambda: copy.copy(ball()),
    "deep copy": lambda: copy.deepcopy(ball()),
    "copy of a primitive": lambda: trimesh.primitives.Sphere().copy(),
    "shallow copy of a primitive": lambda: copy.copy(trimesh.primitives.Sphere()),
    "deep copy of a primitive": lambda: copy.deepcopy(trimesh.primitives.Sphere()),
    "mesh of a primitive": lambda: trimesh.primitives.Sphere().to_mesh(),
    "one of submeshes": lambda: ball().submesh([np.arange(320), [0]])[0],
    "submesh": lambda: ball().submesh([np.arange(320)], append=True),
    "sum": lambda: ball() + ball().apply_translation([5, 0, 0]),
    "concatenation": lambda: trimesh.util.concatenate([ball(), ball().apply_translation([5, 0, 0])]),
    "subdivided": lambda: ball().subdivide(),
    "of a scene": lambda: trimesh.util.concatenate(trimesh.Scene([ball()]).dump()),
    "in a scene": lambda: next(iter(trimesh.Scene([ball()]).geometry.values())),
    "loaded from STL": lambda: loaded("stl"),
    "loaded from PLY": lambda: loaded("ply"),
    "loaded from OBJ": lambda: loaded("obj"),
    "unpickled": lambda: pickle.loads(pickle.dumps(ball())),
}


def assert_wive_answers(mesh):
    assert type(mesh.ray) is RayMeshIntersector
    assert mesh.ray is mesh.ray
    assert mesh.ray.mesh is mesh
    points = np.random.default_rng(1).uniform(-1.2, 1.2, (50, 3))
    size = np.linalg.norm(points, axis=1)
    points = points[(size < 0.9) | (size > 1.05)]
    np.testing.assert_array_equal(mesh.contains(points), np.linalg.norm(points, axis=1) < 1)
    assert mesh.ray.intersects_any([[0.1, 0.2, -5], [3, 3, 3]], [[0, 0, 1.0], [0, 0, 1]]).tolist() == [
        True,
        False,
    ]


@pytest.mark.parametrize("make", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("first", ["mesh", "wive"])
def test_every_mesh_uses_wive(make, first):
    if first == "wive":
        install()
    mesh = make()
    own = vars(mesh)["ray"]
    install()
    assert_wive_answers(mesh)
    assert_wive_answers(mesh.copy())
    uninstall()
    assert mesh.ray is own
    assert type(own).__module__.startswith("trimesh.ray")


@pytest.mark.parametrize("embreex", ["installed", "missing"])
def test_embreex_makes_no_difference(embreex, tmp_path):
    program = f"""
import sys
if {embreex == "missing"}:
    sys.modules["embreex"] = None  # importing it raises ImportError
import trimesh, wive
assert trimesh.ray.has_embree == {embreex == "installed"}
before = trimesh.creation.icosphere()
own = before.ray
wive.trimesh.install()
for mesh in (before, before.copy(), before + before, trimesh.primitives.Sphere()):
    assert type(mesh.ray) is wive.trimesh.RayMeshIntersector, mesh.ray
    assert mesh.contains([[0.1, 0.2, 0.3], [2, 0, 0]]).tolist() == [True, False]
wive.trimesh.uninstall()
assert before.ray is own
"""
    if embreex == "installed":
        pytest.importorskip("embreex")
    path = tmp_path / "program.py"
    path.write_text(program)
    done = subprocess.run(
        [sys.executable, path], capture_output=True, text=True, timeout=100, cwd=tmp_path, check=False
    )
    assert done.returncode == 0, done.stderr


def test_functions_of_trimesh_give_their_own_results():
    mesh = trimesh.creation.annulus(0.5, 1, 2)
    points, faces = trimesh.sample.sample_surface(mesh, 100, seed=6)
    normals = mesh.face_normals[faces]
    expected = trimesh.proximity.thickness(mesh, points, normals=normals, method="ray")
    with installed():
        assert type(mesh.ray) is RayMeshIntersector
        found = trimesh.proximity.thickness(mesh, points, normals=normals, method="ray")
        inside = trimesh.sample.volume_mesh(mesh, 200)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    radius = np.hypot(inside[:, 0], inside[:, 1])
    assert len(inside) and (abs(inside[:, 2]) <= 1).all() and (radius <= 1).all() and (radius >= 0.48).all()


def test_installing_twice_is_installing_once():
    mesh = ball()
    own = mesh.ray
    uninstall()
    install(nodes="compressed")
    first = mesh.ray
    install(nodes="compressed")
    assert mesh.ray is first  # the tree is kept
    install()
    assert mesh.ray.scene.nodes == "float32"
    uninstall()
    assert mesh.ray is own
    uninstall()
    assert mesh.ray is own


def test_blocks_may_be_nested_and_restore_what_was_before_them():
    mesh = ball()
    own = mesh.ray
    with installed(accuracy="fast"):
        outer = mesh.ray
        with installed(dtype=np.float64):
            assert (mesh.ray.scene.accuracy, mesh.ray.scene.precision) == ("watertight", "float64")
            uninstall()
            assert mesh.ray is own
        assert mesh.ray.scene.accuracy == outer.scene.accuracy == "fast"
        with pytest.raises(KeyError), installed():
            raise KeyError
        assert mesh.ray.scene.accuracy == "fast"
    assert mesh.ray is own
    with installed(accuracy="fast"):
        assert mesh.ray is not outer  # other options were used since
        again = mesh.ray
    with installed(accuracy="fast"):
        assert mesh.ray is again  # the tree is kept
    install(quality="high")
    with installed():
        pass
    assert mesh.ray.scene._options["quality"] == "high"


@pytest.mark.parametrize("use", ["install", "intersector"])
@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("backend", "scalar"),
        ("device", "cpu"),
        ("accuracy", "exact"),
        ("nodes", "compressed"),
        ("quality", "high"),
        ("precision", "float64"),
        ("threads", 1),
        ("scale_to_box", False),
    ],
)
def test_options_pass_through(use, option, value):
    if option == "device":
        pytest.importorskip("warp")
    mesh = ball()
    given = {"dtype" if option == "precision" else option: value}
    if use == "install":
        install(**given)
        found = [mesh.ray, mesh.copy().ray]
    else:
        found = [RayMeshIntersector(mesh, **given), copy.copy(RayMeshIntersector(mesh, **given))]
    for ours in found:
        scene = ours.scene
        reached = {
            "quality": scene._options["quality"],
            "threads": ours._threads,
            "scale_to_box": ours._scale_to_box,
        }
        assert (reached[option] if option in reached else getattr(scene, option)) == value


@pytest.mark.parametrize(
    ("bad", "error", "message"),
    [
        ({"accuracy": "sharp"}, ValueError, "accuracy must be one of fast, watertight, exact"),
        ({"nodes": "small"}, ValueError, "nodes must be one of float32, compressed"),
        ({"quality": "low"}, ValueError, "quality must be one of medium, high"),
        ({"backend": "gpu"}, ValueError, "backend must be one of auto"),
        ({"dtype": np.int32}, ValueError, "dtype must be float32 or float64"),
        ({"dtype": float, "accuracy": "exact"}, ValueError, "dtype must be float32 for accuracy 'exact'"),
        ({"threads": 0}, ValueError, "threads must be from 1"),
        ({"node": "compressed"}, TypeError, "unexpected keyword argument 'node'"),
    ],
)
def test_bad_options_are_refused_at_once_and_change_nothing(bad, error, message):
    mesh = ball()
    install(nodes="compressed")
    for use in (install, lambda **options: installed(**options).__enter__()):
        with pytest.raises(error, match=message):
            use(**bad)
        assert mesh.ray.scene.nodes == "compressed"


def test_threads_are_refused_for_a_warp_device():
    pytest.importorskip("warp")
    with pytest.raises(ValueError, match="threads is only for CPU backends, got 2 with backend 'warp'"):
        install(device="cpu", threads=2)
    assert type(ball().ray) is not RayMeshIntersector


def test_a_pickled_mesh_needs_no_wive():
    install()
    mesh = ball()
    assert mesh.contains([[0, 0, 0.1]])[0]
    texts = [
        argument for _, argument, _ in pickletools.genops(pickle.dumps(mesh)) if isinstance(argument, str)
    ]
    assert texts and not any(text.startswith("wive") for text in texts)


def test_an_intersector_that_a_user_assigns_is_used():
    class Own:
        pass

    before, after, own = ball(), ball(), Own()
    chosen = RayMeshIntersector(before, dtype=np.float64)
    before.ray = chosen
    install()
    assert before.ray is chosen
    after.ray = own
    assert after.ray is own
    theirs = trimesh.ray.ray_triangle.RayMeshIntersector(after)
    after.ray = theirs
    assert after.ray is theirs
    assert type(after.copy().ray) is RayMeshIntersector
    uninstall()
    assert before.ray is chosen
    assert after.ray is theirs
    after.ray = trimesh.ray.ray_triangle.RayMeshIntersector(after)  # as trimesh makes them
    install()
    assert type(after.ray) is RayMeshIntersector


def test_changes_of_a_mesh_are_followed():
    install()
    mesh = ball()
    ray = [[0.0, 0, 0]], [[0.0, 0, 1]]
    assert mesh.ray.intersects_any(*ray)[0]
    mesh.apply_translation([10, 0, 0])
    assert not mesh.ray.intersects_any(*ray)[0]


def test_the_class_and_meshes_without_an_intersector_answer_as_before():
    install()
    mesh = ball()
    del mesh.ray
    assert not hasattr(mesh, "ray")
    assert not hasattr(trimesh.Trimesh.__new__(trimesh.Trimesh), "ray")
    uninstall()
    assert not hasattr(trimesh.Trimesh, "ray")


def test_a_missing_trimesh_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ImportError, match=r"^wive\.trimesh needs trimesh \(.*\): pip install trimesh$"):
        wive.trimesh.install()
    monkeypatch.undo()
