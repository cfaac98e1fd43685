"""Float64 scenes in files, pickles, on the command line and behind trimesh; and refitted."""

import json
import pickle

import numpy as np
import pytest
from support.doubles import CPU, UTM, rays64, survey
from support.meshes import assert_same_hits, sphere

import wive
from wive.cli import main


@pytest.fixture(params=CPU)
def cpu(request):
    return request.param


def test_a_saved_or_pickled_scene_keeps_its_precision(tmp_path):
    mesh, rays = survey(), (UTM + np.zeros((200, 3)), rays64(200, seed=9)[1])
    scene = wive.Scene(*mesh, accuracy="fast", nodes="compressed")
    hits = scene.intersect(*rays)
    scene.save(tmp_path / "scene")
    for again in (wive.load(tmp_path / "scene"), pickle.loads(pickle.dumps(scene))):
        assert (again.precision, again.accuracy, again.nodes) == ("float64", "fast", "compressed")
        np.testing.assert_array_equal(again.vertices, mesh[0])
        assert_same_hits(again.intersect(*rays), hits)
    copied = pickle.loads(pickle.dumps(hits))
    np.testing.assert_array_equal(copied.points(), hits.points())
    np.testing.assert_array_equal(copied.error_bound, hits.error_bound)
    single = wive.Scene(*sphere(1))
    single.save(tmp_path / "single")
    assert wive.load(tmp_path / "single").precision == "float32"


def test_files_of_the_first_version_still_load(tmp_path):
    vertices, faces = sphere(1)
    options = {"backend": "auto", "device": None, "accuracy": "watertight", "nodes": "float32"}
    header = json.dumps({"format": "wive scene", "version": 1, "options": options})
    with open(tmp_path / "old", "wb") as file:
        np.savez(file, header=np.array(header), vertices=vertices, faces=faces)
    scene = wive.load(tmp_path / "old")
    assert scene.precision == "float32"
    np.testing.assert_array_equal(scene.vertices, vertices)


def test_refit_converts_to_the_scenes_precision_and_keeps_what_is_ready(cpu):
    vertices, faces = survey(2)
    moved = vertices + np.array([0.001, 0.0, -0.002])
    scene = wive.Scene(vertices, faces, backend=cpu)
    scene.refit(moved)
    assert np.shares_memory(scene.vertices, moved)
    rays = UTM + np.zeros((300, 3)), rays64(300, seed=10)[1]
    assert_same_hits(scene.intersect(*rays), wive.Scene(moved, faces, backend=cpu).intersect(*rays))
    for given in (moved.astype(np.float32), np.float64(moved).tolist(), np.round(moved).astype(int)):
        scene.refit(given)
        assert scene.precision == "float64"
        np.testing.assert_array_equal(scene.vertices, np.asarray(given, np.float64))
        assert scene.intersect(*rays).t.dtype == np.float64
    single = wive.Scene(*sphere(2), backend=cpu)
    single.refit(2.0 * sphere(2)[0].astype(np.float64))
    assert single.precision == single.vertices.dtype == single.bounds.dtype == "float32"


def test_mesh_files_are_float32_unless_float64_is_asked_for(tmp_path):
    vertices, faces = survey(1)
    np.savez(tmp_path / "survey.npz", vertices=vertices, faces=faces)
    files = [tmp_path / "survey.npz"]
    try:
        import trimesh
    except ImportError:
        pass
    else:
        trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "survey.obj")
        files.append(tmp_path / "survey.obj")
    for path in files:
        assert wive.load_mesh(path)[0].dtype == wive.Scene.from_file(path).precision == "float32"
        loaded, loaded_faces = wive.load_mesh(path, np.float64)
        assert loaded.dtype == np.float64
        np.testing.assert_allclose(loaded[loaded_faces], vertices[faces], rtol=0, atol=1e-6)
        scene = wive.Scene.from_file(path, dtype="float64", accuracy="fast")
        assert (scene.precision, scene.accuracy) == ("float64", "fast")
        hit = scene.intersect(UTM + np.array([0, 0, 5]), [0.001, 0.002, -1.0])
        assert hit.points()[0, 2] - UTM[2] == pytest.approx(1, abs=0.05)
    for bad in (np.int32, "half", None, 3):
        with pytest.raises(ValueError, match=r"^dtype must be float32 or float64, got "):
            wive.load_mesh(files[0], bad)


def test_the_command_line_takes_float64(tmp_path, capsys):
    vertices, faces = survey(2)
    np.savez(tmp_path / "survey.npz", vertices=vertices, faces=faces)
    origins, directions = UTM + np.zeros((50, 3)), rays64(50, seed=14)[1]
    np.save(tmp_path / "rays.npy", np.column_stack([origins, directions]))
    mesh, rays, found = (str(tmp_path / name) for name in ("survey.npz", "rays.npy", "hits.npz"))
    assert main(["trace", mesh, rays, "-o", found, "--precision", "float64"]) == 0
    with np.load(found) as hits:
        expected = wive.Scene(vertices, faces).intersect(origins, directions)
        np.testing.assert_array_equal(hits["t"], expected.t)
        assert hits["t"].dtype == hits["uv"].dtype == np.float64
    capsys.readouterr()
    assert main(["info", mesh, "--precision", "float64"]) == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert lines["precision"] == "float64"
    assert lines["bounds"].startswith("448261.")


def test_trimesh_adapter_resolves_in_float64_what_float32_can_not():
    trimesh = pytest.importorskip("trimesh")
    heights = 1 + np.arange(50) * 1e-10
    corners = np.tile([[-1.0, -1, 0], [3, -1, 0], [-1, 3, 0]], (50, 1, 1))
    corners[:, :, 2] = heights[::-1, None]
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(150).reshape(-1, 3), process=False)
    ours = wive.trimesh.RayMeshIntersector(mesh, dtype=np.float64)
    assert ours.scene.precision == "float64"
    assert wive.trimesh.RayMeshIntersector(mesh).scene.precision == "float32"
    ray = [[0, 0, 0.0]], [[0, 0, 5.0]]
    points, _, triangles = ours.intersects_location(*ray)
    np.testing.assert_array_equal(triangles, np.arange(50)[::-1])
    np.testing.assert_allclose(points[:, 2], heights, rtol=1e-15)
    assert ours.intersects_first(*ray)[0] == 49
    for again in (pickle.loads(pickle.dumps(ours)), ours.__copy__()):
        assert again.scene.precision == "float64"
        np.testing.assert_array_equal(again.intersects_id(*ray)[0], triangles)
    with pytest.raises(ValueError, match="dtype must be float32 or float64"):
        wive.trimesh.RayMeshIntersector(mesh, dtype=int)


def test_the_adapter_finds_points_inside_a_mesh_in_float64():
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = survey(3)
    ours = wive.trimesh.RayMeshIntersector(trimesh.Trimesh(vertices, faces, process=False), dtype="float64")
    random = np.random.default_rng(15)
    directions = random.standard_normal((2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    inside = np.arange(2000) % 2 == 0
    distance = np.where(inside, random.uniform(0, 0.95, 2000), random.uniform(1.01, 2, 2000))
    np.testing.assert_array_equal(ours.contains_points(UTM + directions * distance[:, None]), inside)
