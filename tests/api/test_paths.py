"""Paths are text, bytes or path objects, everywhere that a file is named."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from support.meshes import TRIANGLE

import wive
from wive._internal.files import check_output
from wive._internal.npzfile import check_input
from wive._internal.pictures.image_files import check_picture_output


class Named:
    """A path object of a library that is not pathlib."""

    def __init__(self, name):
        self.name = name

    def __fspath__(self):
        return self.name


FORMS = {
    "text": os.fspath,
    "bytes": os.fsencode,
    "pathlib": Path,
    "object of text": lambda path: Named(os.fspath(path)),
    "object of bytes": lambda path: Named(os.fsencode(path)),
}


@pytest.fixture(params=FORMS)
def form(request):
    return FORMS[request.param]


@pytest.mark.parametrize("name", ["scene.wive", "Körper ☃.wive", b"latin-1 \xe4.wive"])
def test_scenes_are_saved_and_loaded(tmp_path, form, name):
    path = tmp_path / os.fsdecode(name)
    try:
        path.touch()
    except OSError:
        pytest.skip("the system has no such file names")
    wive.Scene(*TRIANGLE).save(form(path))
    assert [part.name for part in tmp_path.iterdir()] == [path.name]
    assert len(wive.load(form(path))) == 1


def test_meshes_are_loaded(tmp_path, form):
    path = tmp_path / "mesh.npz"
    np.savez(path, vertices=TRIANGLE[0], faces=TRIANGLE[1])
    if isinstance(form(path), bytes):
        with pytest.raises(
            ValueError, match=r"^mesh \(bytes\): is the name of a file, not its content: pass '/"
        ):
            wive.load_mesh(form(path))
        return
    assert len(wive.load_mesh(form(path))[1]) == len(wive.Scene.from_file(form(path))) == 1


def test_pictures_are_written(tmp_path, form):
    pytest.importorskip("PIL")
    path = tmp_path / "x.png"
    assert check_picture_output(form(path)) == str(path)
    wive.write_picture(form(path), np.zeros((2, 2, 3), np.float32))
    assert path.stat().st_size > 0


@pytest.mark.parametrize("check", [check_input, check_output, wive.load, wive.Scene(*TRIANGLE).save])
@pytest.mark.parametrize("value", [3, None, 2.5, ["a"], object(), Named(3)])
def test_what_is_no_path_is_a_type_error(check, value):
    with pytest.raises(TypeError, match=r"^path must be a file name, got "):
        check(value)


def test_errors_name_the_file_as_text(tmp_path):
    wive.Scene(*TRIANGLE, backend="scalar").save(tmp_path / "scene")
    for broken in (os.fsencode(tmp_path / "scene"), Named(os.fsencode(tmp_path / "scene"))):
        with pytest.raises(ValueError) as error:
            wive.load(broken, backend="none")
        assert str(error.value).startswith(f"{tmp_path / 'scene'}: backend must be")
    with pytest.raises(FileNotFoundError) as error:
        wive.load(os.fsencode(tmp_path / "missing"))
    assert str(error.value) == f"{tmp_path / 'missing'}: no such file"
    assert len(pickle.loads(pickle.dumps(wive.load(os.fsencode(tmp_path / "scene"))))) == 1


def test_names_with_line_breaks_stay_on_one_line(tmp_path):
    path = tmp_path / "two\nlines"
    for content in (None, b"", b"PK", b"hello"):
        if content is not None:
            path.write_bytes(content)
        for call in (wive.load, wive.load_mesh):
            with pytest.raises((ValueError, OSError)) as error:
                call(path)
            assert str(error.value).isprintable() and "two\\nlines" in str(error.value)
