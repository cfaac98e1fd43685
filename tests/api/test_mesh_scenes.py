"""Files of scenes that are cut off are refused in one line, other formats by name."""

import sys

import pytest
from support.refusals import load_or_refusal
from support.scene_files import FILES

import wive


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_cut_off_are_refused_at_every_length(name):
    kind, make = FILES[name]
    data = make()
    lengths = range(1, len(data)) if len(data) < 1000 else range(1, len(data), len(data) // 300)
    whole = [length for length in lengths if not load_or_refusal(data[:length], kind)]
    assert whole == []


@pytest.mark.parametrize("name", FILES)
def test_files_need_no_package_but_numpy(name, monkeypatch):
    for package in ("trimesh", "lxml", "networkx", "collada", "PIL", "charset_normalizer", "DracoPy"):
        monkeypatch.setitem(sys.modules, package, None)
    kind, make = FILES[name]
    assert load_or_refusal(make(), kind) == ""


def test_reading_prints_and_logs_nothing(capfd, caplog):
    caplog.set_level(0)
    for kind, make in FILES.values():
        load_or_refusal(make(), kind)
        load_or_refusal(make()[:-1], kind)
    assert capfd.readouterr() == ("", "")
    assert not caplog.records


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("xyz", "holds points and no triangles"),
        ("step", "holds surfaces and no triangles: tessellate it"),
        ("zip", "is an archive: unpack it"),
        ("dxf", "holds a drawing and no triangles"),
        ("binvox", "holds voxels and no triangles"),
        (
            "3dxml",
            "files of type '3dxml' are not read: convert it to PLY, OBJ, STL, OFF, glTF, 3MF or COLLADA",
        ),
        ("fbx", "files of type 'fbx' are not read: convert it to PLY"),
    ],
)
def test_other_formats_are_refused_by_name(tmp_path, kind, expected):
    path = tmp_path / f"model.{kind}"
    path.write_bytes(b"anything")
    with pytest.raises(ValueError) as error:
        wive.load_mesh(path)
    assert str(error.value).startswith(f"{path}: {expected}")
