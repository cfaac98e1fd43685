"""Scenes and meshes in files, and in pickles."""

import pickle

import numpy as np
import pytest
from support.meshes import TRIANGLE, assert_same_hits, random_rays, soup, sphere

import wive
from wive._internal.tree_file import Image


def test_pickled_scenes_and_hits_are_the_same(backend):
    scene = wive.Scene(*soup(500, seed=17), backend=backend, accuracy="fast")
    rays = random_rays(1000, seed=18)
    hits = scene.intersect(*rays)
    again = pickle.loads(pickle.dumps(scene))
    assert (again.backend, again.accuracy) == (backend, "fast")
    assert_same_hits(again.intersect(*rays), hits)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(hits)).points(), hits.points())


def test_saved_scenes_load_the_same(backend, tmp_path):
    scene = wive.Scene(*soup(500, seed=19), backend=backend, accuracy="fast")
    rays = random_rays(1000, seed=20)
    path = tmp_path / "scene.wive"
    scene.save(path)
    assert [file.name for file in tmp_path.iterdir()] == ["scene.wive"]
    again = wive.load(path)
    assert (again.backend, again.accuracy) == (backend, "fast")
    assert_same_hits(again.intersect(*rays), scene.intersect(*rays))
    assert wive.load(path, backend="scalar").backend == "scalar"


@pytest.mark.parametrize("name", ["scene.wive", "scene.npz"])
def test_a_failed_save_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, name):
    path = tmp_path / name
    wive.Scene(*TRIANGLE).save(path)
    whole = path.read_bytes()

    def half_written(file, **arrays):
        file.write(b"half")
        raise OSError("disk full")

    def half_an_image(image):
        yield b"half"
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez", half_written)
    monkeypatch.setattr(Image, "pieces", half_an_image)
    with pytest.raises(OSError, match="disk full"):
        wive.Scene(*sphere(0)).save(path)
    assert path.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "glb", "off"])
def test_mesh_files_give_their_triangles(tmp_path, suffix):
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = sphere(1)
    path = tmp_path / f"sphere.{suffix}"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    loaded_vertices, loaded_faces = wive.load_mesh(path)
    np.testing.assert_allclose(loaded_vertices[loaded_faces], vertices[faces], atol=1e-6)
    assert len(wive.Scene.from_file(str(path), accuracy="fast")) == 80


def test_a_file_of_several_meshes_is_joined_and_placed(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    whole = trimesh.Scene()
    ball = trimesh.Trimesh(*sphere(1), process=False)
    for x in (0, 10):
        whole.add_geometry(ball, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    whole.export(tmp_path / "two.glb")
    scene = wive.Scene.from_file(tmp_path / "two.glb")
    assert len(scene) == 160
    assert scene.intersect([-20, 0.01, 0.02], [1, 0, 0]).t[0] == pytest.approx(19, abs=0.1)
    assert scene.intersect([30, 0.01, 0.02], [-1, 0, 0]).t[0] == pytest.approx(19, abs=0.1)


def test_npz_meshes_give_their_arrays_as_float32(tmp_path):
    vertices, faces = sphere(0)
    np.savez(tmp_path / "mesh.npz", vertices=vertices.astype(np.float64), faces=faces)
    loaded_vertices, loaded_faces = wive.load_mesh(tmp_path / "mesh.npz")
    assert loaded_vertices.dtype == np.float32
    np.testing.assert_array_equal(loaded_vertices, vertices)
    np.testing.assert_array_equal(loaded_faces, faces)
