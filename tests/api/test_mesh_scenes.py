"""Files of scenes, damaged in any way, give a mesh or one line; other formats are refused by name."""

import base64
import io
import json
import sys
import zipfile
from collections.abc import Callable

import numpy as np
import pytest
from support import dae_files, threemf_files
from support.gltf_files import Model, primitive
from support.mesh_files import damaged

import wive

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
FACES = [[0, 1, 2], [0, 2, 3]]


def model() -> Model:
    """A document with what the reader follows: sparse values, instances, a skin, a morph target."""
    model = Model()
    position, indices = model.array(POINTS, "f4"), model.array(np.ravel(FACES), "u2")
    sparse = {
        "count": 1,
        "indices": {"bufferView": model.view(b"\2\0"), "componentType": 5123},
        "values": {"bufferView": model.view(np.float32([3, 3, 0]).tobytes())},
    }
    moved = model.accessor(**{**model.json["accessors"][position], "sparse": sparse})
    small = model.array(POINTS * 100, "u1", normalized=True)
    rigid = {
        "JOINTS_0": model.array(np.zeros((4, 4)), "u1"),
        "WEIGHTS_0": model.array(np.tile([1, 0, 0, 0], (4, 1)), "f4"),
    }
    first = model.mesh(primitive(moved, indices), primitive(small, mode=5))
    second = model.mesh(primitive(position, indices, targets=[{"POSITION": moved}]), weights=[0.5])
    third = model.mesh({"attributes": {"POSITION": position, **rigid}, "mode": 6})
    child = model.node(root=False, mesh=first, rotation=[0, 0, 0.6, 0.8])
    model.node(mesh=second, scale=[1, -1, 1], children=[child])
    model.json["skins"] = [
        {"joints": [child], "inverseBindMatrices": model.array(np.eye(4).reshape(1, 16), "f4")}
    ]
    model.node(mesh=third, skin=0)
    shifts = {"attributes": {"TRANSLATION": model.array([[0, 0, 1], [0, 0, 2]], "f4")}}
    model.node(mesh=first, extensions={"EXT_mesh_gpu_instancing": shifts})
    return model


def gltf() -> bytes:
    whole = model()
    whole.json["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(whole.blob).decode()
    return json.dumps(whole.json).encode()


def threemf() -> bytes:
    objects = {
        "1": threemf_files.mesh(POINTS, FACES),
        "2": threemf_files.components('objectid="1"', 'objectid="1"'),
    }
    root = threemf_files.model(objects, ['objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"', 'objectid="1"'])
    return threemf_files.package(root)


def threemf_stored() -> bytes:
    """The package without compression, so that damage reaches the XML, and without checksums' help."""
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(threemf())) as packed, zipfile.ZipFile(file, "w") as archive:
        for name in packed.namelist():
            archive.writestr(name, packed.read(name))
    return file.getvalue()


def dae() -> bytes:
    kinds = [
        dae_files.primitive("polylist", [0, 1, 2, 3], vcount=[4]),
        dae_files.primitive("tristrips", [0, 1, 2, 3]),
    ]
    shape = dae_files.geometry("a", POINTS, *kinds)
    inner = dae_files.node("<rotate>0 0 1 30</rotate>", dae_files.draw("a"), key="n")
    return dae_files.document(shape, inner + '<instance_node url="#n"/>').encode()


FILES: dict[str, tuple[str, Callable[[], bytes]]] = {
    "glb": ("glb", lambda: model().glb()),
    "gltf": ("gltf", gltf),
    "3mf": ("3mf", threemf),
    "3mf, stored": ("3mf", threemf_stored),
    "dae": ("dae", dae),
}


def check_mesh_or_refusal(data: bytes, kind: str) -> bool:
    """Whether the file gives a mesh; fails unless it does or is refused by a line that names it."""
    try:
        vertices, faces = wive.load_mesh(data, file_type=kind)
    except ValueError as error:
        text = str(error)
        assert text.startswith("mesh (bytes): ") and text.isprintable() and len(text) < 600, text
        return False
    assert vertices.dtype == np.float32 and vertices.shape[1:] == (3,)
    assert faces.dtype == np.int32 and faces.shape[1:] == (3,)
    assert len(faces) and faces.min() >= 0 and faces.max() < len(vertices)
    return True


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize(
    "number", [300, pytest.param(20_000, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])]
)
def test_damaged_files_give_a_mesh_or_one_line(name, number):
    kind, make = FILES[name]
    data = make()
    assert check_mesh_or_refusal(data, kind)
    random = np.random.default_rng(number)
    read = [check_mesh_or_refusal(damaged(data, random), kind) for _ in range(number)]
    assert not all(read)


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_cut_off_are_refused_at_every_length(name):
    kind, make = FILES[name]
    data = make()
    lengths = range(1, len(data)) if len(data) < 1000 else range(1, len(data), len(data) // 300)
    whole = [length for length in lengths if check_mesh_or_refusal(data[:length], kind)]
    assert whole == []


@pytest.mark.parametrize("name", FILES)
def test_files_need_no_package_but_numpy(name, monkeypatch):
    for package in ("trimesh", "lxml", "networkx", "collada", "PIL", "charset_normalizer", "DracoPy"):
        monkeypatch.setitem(sys.modules, package, None)
    kind, make = FILES[name]
    assert check_mesh_or_refusal(make(), kind)


def test_reading_prints_and_logs_nothing(capfd, caplog):
    caplog.set_level(0)
    for kind, make in FILES.values():
        check_mesh_or_refusal(make(), kind)
        check_mesh_or_refusal(make()[:-1], kind)
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
