"""What a newer wive wrote says so, and a saved scene where a mesh is expected names `wive.load`."""

import json
import pickle

import numpy as np
import pytest
from support.meshes import TRIANGLE

import wive
from wive._internal.storage import FORMAT_VERSION
from wive.cli import main
from wive.scene import _rebuild

OPTIONS = {"backend": "auto", "device": None, "accuracy": "fast", "nodes": "float32", "quality": "medium"}


def write(path, header: object, **arrays: object) -> None:
    with open(path, "wb") as file:
        np.savez(file, header=np.array(json.dumps(header)), **arrays)


def header(**changes: object) -> dict[str, object]:
    return {"format": "wive scene", "version": FORMAT_VERSION, "options": OPTIONS, **changes}


MESH = dict(zip(("vertices", "faces"), TRIANGLE, strict=True))
NEWER = [
    header(version=2),
    header(version=2, options={"engine": "x"}),
    header(version=10**30, options=None),
    {"format": "wive scene", "version": 3},
]


@pytest.mark.parametrize("content", NEWER)
@pytest.mark.parametrize("arrays", [MESH, {}, {"tree": [1]}])
def test_a_file_of_a_newer_version_says_so(tmp_path, capsys, content, arrays):
    path = tmp_path / "scene"
    write(path, content, **arrays)
    expected = (
        f"{path}: scene file of version {content['version']}, written by a newer wive; this is wive "
        f"{wive.__version__}, which reads version 1: upgrade wive, or save the scene again with this one"
    )
    for read in (wive.load, wive.load_mesh, wive.Scene.from_file):
        with pytest.raises(ValueError) as error:
            read(path)
        assert str(error.value) == expected
    assert main(["info", str(path)]) == 2
    assert capsys.readouterr().err == f"wive: error: {expected}\n"


def test_the_writer_is_named_if_the_file_names_it(tmp_path):
    path = tmp_path / "scene"
    write(path, header(version=2, wive="3.1.4"), **MESH)
    with pytest.raises(ValueError, match=r"written by wive 3\.1\.4; this is wive"):
        wive.load(path)


@pytest.mark.parametrize(
    "content",
    [
        header(options={**OPTIONS, "a\n\x9d\x1b[2J": 1}),
        header(options={**OPTIONS, "a" * 5000: 1}),
        header(version=10**4000),
        header(version=2, wive="3\n\x1b[2J"),
        header(version=2, wive="3" * 5000),
    ],
)
def test_a_newer_files_words_stay_on_one_short_line(tmp_path, content):
    path = tmp_path / "scene"
    write(path, content, **MESH)
    with pytest.raises(ValueError, match="upgrade wive") as error:
        wive.load(path)
    assert str(error.value).isprintable() and len(str(error.value)) < len(str(path)) + 300


def test_options_that_are_unknown_are_not_dropped(tmp_path):
    path = tmp_path / "scene"
    write(path, header(options={**OPTIONS, "engine": "x", "cache": 3}), **MESH)
    with pytest.raises(ValueError, match=r"with unknown options \(cache, engine\), written by a newer wive"):
        wive.load(path)


@pytest.mark.parametrize("version", [0, -1, "2", None, 1.5, True, [2]])
def test_a_version_that_is_none_is_no_scene(tmp_path, version):
    path = tmp_path / "scene"
    write(path, header(version=version), **MESH)
    with pytest.raises(ValueError) as error:
        wive.load(path)
    assert str(error.value) == f"{path}: not a scene saved by wive"


@pytest.mark.parametrize("content", [[], "text", 5, None, {"format": "wive scene"}, {"version": 2}])
def test_a_header_that_is_none_is_no_scene(tmp_path, content):
    path = tmp_path / "scene"
    write(path, content, **MESH)
    with pytest.raises(ValueError) as error:
        wive.load(path)
    assert str(error.value) == f"{path}: not a scene saved by wive"


class Newer:
    """A scene as a newer wive would pickle it."""

    def __init__(self, *state: object) -> None:
        self.state = state

    def __reduce__(self):
        return _rebuild, self.state


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        ((*TRIANGLE, OPTIONS, 2), "pickled scene of version 2, written by a newer wive"),
        ((*TRIANGLE, {**OPTIONS, "engine": "x"}), "pickled scene with unknown options"),
    ],
)
def test_a_pickle_of_a_newer_wive_says_so(state, expected):
    with pytest.raises(ValueError, match=expected):
        pickle.loads(pickle.dumps(Newer(*state)))


def test_pickles_from_before_versions_still_load():
    assert len(pickle.loads(pickle.dumps(Newer(*TRIANGLE, OPTIONS)))) == 1


@pytest.mark.parametrize("name", ["scene.wive", "scene.npz", "scene", "scene.stl"])
def test_a_saved_scene_where_a_mesh_is_expected_names_load(tmp_path, name):
    saved = tmp_path / name.replace(".stl", ".wive")
    wive.Scene(*TRIANGLE).save(saved)
    path = saved.rename(tmp_path / name)
    for source in (path, path.read_bytes()):
        with pytest.raises(ValueError) as error:
            wive.load_mesh(source)
        assert str(error.value).endswith(
            ": is a scene that Scene.save wrote and no mesh: open it with wive.load(path)"
        )
    assert len(wive.Scene.from_file(path)) == 1


def test_a_mesh_with_a_header_of_its_own_is_a_mesh(tmp_path):
    for number, content in enumerate(([1, 2], "text", json.dumps({"format": "other"}))):
        path = tmp_path / f"mesh{number}.npz"
        np.savez(path, header=np.array(content), **MESH)
        assert len(wive.load_mesh(path)[1]) == 1
