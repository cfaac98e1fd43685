"""Files that can't be read or written end in one line that names the file."""

import json

import numpy as np
import pytest
from support.meshes import TRIANGLE

import wive
from wive._internal.npzfile import open_npy_or_npz

VERTICES, FACES = TRIANGLE


def message(error: pytest.ExceptionInfo[Exception]) -> str:
    text = str(error.value)
    assert "\n" not in text
    return text


def write_bytes(path, count: int) -> None:
    path.write_bytes(np.random.default_rng(1).bytes(count))


@pytest.mark.parametrize(
    ("name", "write", "expected"),
    [
        ("missing.stl", lambda path: None, "no such file"),
        ("folder.stl", lambda path: path.mkdir(), "not a file"),
        ("empty.ply", lambda path: path.touch(), "is empty"),
        (
            "text.xyz123",
            lambda path: path.write_text("hello"),
            "files of type 'xyz123' are not read: convert it to PLY",
        ),
        ("noise.ply", lambda path: write_bytes(path, 1000), "line 1: expected `ply`, got"),
        ("noise.glb", lambda path: write_bytes(path, 1000), "JSON: expected a glTF document"),
        (
            "noise.npz",
            lambda path: write_bytes(path, 1000),
            "not an npz file of arrays `vertices` and `faces`, or damaged",
        ),
        ("points.obj", lambda path: path.write_text("v 0 0 0\nv 1 0 0\n"), ""),
        ("other.npz", lambda path: np.savez(path, x=[1]), "expected arrays `vertices` and `faces`, found x"),
        ("none.npz", lambda path: np.savez(path, vertices=VERTICES, faces=FACES[:0]), "has no triangles"),
    ],
)
def test_a_file_that_is_no_mesh_is_named(tmp_path, name, write, expected):
    path = tmp_path / name
    write(path)
    with pytest.raises((ValueError, OSError)) as error:
        wive.load_mesh(path)
    assert message(error).startswith(f"{path}: {expected}")


def test_a_truncated_npz_is_damaged(tmp_path):
    path = tmp_path / "mesh.npz"
    np.savez(path, vertices=VERTICES, faces=FACES)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ValueError, match="or damaged") as error:
        wive.load_mesh(path)
    assert str(path) in message(error)


def header(**changes) -> np.ndarray:
    options = {"backend": "auto", "accuracy": "fast", "nodes": "float32"}
    return np.array(json.dumps({"format": "wive scene", "version": 1, "options": options, **changes}))


@pytest.mark.parametrize(
    ("arrays", "expected"),
    [
        ({"x": [1]}, "not a scene saved by wive, but a mesh: wive.Scene.from_file reads meshes"),
        ({"header": np.array("hello")}, "not a scene saved by wive"),
        ({"header": header(format="other")}, "not a scene saved by wive"),
        ({"header": header(options={})}, "not a scene saved by wive"),
        ({"header": header(version=2)}, "scene file of version 2, written by a newer wive"),
        ({"header": header(), "vertices": VERTICES[:2]}, "faces must index the 2 vertices from 0"),
    ],
)
def test_a_file_that_is_no_scene_is_named(tmp_path, arrays, expected):
    path = tmp_path / "scene"
    with open(path, "wb") as file:
        np.savez(file, **{"vertices": VERTICES, "faces": FACES, **arrays})
    with pytest.raises(ValueError) as error:
        wive.load(path)
    assert message(error).startswith(f"{path}: {expected}")


def test_loading_what_is_no_file_or_no_npz(tmp_path):
    path = tmp_path / "scene"
    with pytest.raises(FileNotFoundError, match="no such file"):
        wive.load(path)
    np.save(tmp_path / "array.npy", VERTICES)
    for content in (b"", b"hello", (tmp_path / "array.npy").read_bytes()):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="not a scene saved by wive") as error:
            wive.load(path)
        assert str(path) in message(error)


@pytest.mark.parametrize("name", ["part.obj", "part.PLY", "part.stl", "part.off", "part.glb", "part.3mf"])
def test_loading_a_mesh_file_names_what_reads_it(tmp_path, name):
    path = tmp_path / name
    path.write_text("v 0 0 0\n")
    with pytest.raises(ValueError) as error:
        wive.load(path)
    assert message(error) == (
        f"{path}: not a scene saved by wive, but a mesh by its name: wive.Scene.from_file reads meshes"
    )
    wive.Scene(VERTICES, [[0, 1, 2]]).save(tmp_path / "part.wive")
    (tmp_path / "part.wive").rename(path)  # the content counts, not the name
    assert len(wive.load(path)) == 1


def test_a_damaged_npy_header_is_damage_and_not_a_python_error(tmp_path):
    np.save(tmp_path / "rays.npy", np.zeros((5, 6)))
    content = (tmp_path / "rays.npy").read_bytes()
    for old, new in ((b"}", b"("), (b"(5, 6)", b"(5, -6"), (b"<f8", b"<x8")):
        path = tmp_path / "damaged.npy"
        path.write_bytes(content.replace(old, new))
        with pytest.raises(ValueError) as error, open_npy_or_npz(path, "a file of rays"):
            pass
        assert message(error).startswith(f"{path}: not a file of rays, or damaged (its array: ")


def test_saving_into_a_folder_that_can_not_be_written(tmp_path):
    scene = wive.Scene(VERTICES, FACES)
    with pytest.raises(FileNotFoundError, match=r"output folder .* does not exist: create it first"):
        scene.save(tmp_path / "nowhere" / "scene")
    with pytest.raises(ValueError, match="is not an ordinary file"):
        scene.save(tmp_path)
