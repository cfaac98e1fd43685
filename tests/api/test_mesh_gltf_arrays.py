"""Arrays of glTF files: every type, stride, offset, sparse value and compression, or a refusal."""

import sys

import numpy as np
import pytest
from support.gltf_files import (
    CORNERS,
    LISTED,
    SQUARE,
    Model,
    compressed,
    corners,
    primitive,
    square,
)
from support.refusals import refusal

import wive


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
def test_indices_of_every_width_are_read(dtype):
    model, position, indices = square(dtype)
    model.node(mesh=model.mesh(primitive(position, indices)))
    vertices, faces = wive.load_mesh(model.glb())
    assert vertices.tolist() == SQUARE.tolist()
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    ("dtype", "most"), [("i1", 127), ("u1", 255), ("i2", 32767), ("u2", 65535)], ids=["i1", "u1", "i2", "u2"]
)
@pytest.mark.parametrize("normalized", [False, True])
def test_quantised_positions_are_scaled_as_the_file_says(dtype, most, normalized):
    model = Model()
    stored = np.zeros((4, 4), f"<{dtype}")  # a fourth component pads the stride to a multiple of four
    stored[:, :3] = SQUARE * most
    view = model.view(stored.tobytes(), byteStride=stored.strides[0])
    position = model.accessor(
        bufferView=view,
        componentType={"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123}[dtype],
        count=4,
        type="VEC3",
        normalized=normalized,
    )
    model.json["extensionsUsed"] = model.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    scale = 0.5 if normalized else 0.5 / most
    model.node(mesh=model.mesh(primitive(position, model.array(LISTED, "u1"))), scale=[scale] * 3)
    assert np.abs(corners(model.glb()) - CORNERS / 2).max() < 1e-15


def test_the_least_normalised_integer_is_minus_one():
    model = Model()
    position = model.array(np.array([[-128, -127, 0], [127, 0, 0], [0, 127, 0]]), "i1", normalized=True)
    model.node(mesh=model.mesh(primitive(position)))
    assert wive.load_mesh(model.glb())[0][0].tolist() == [-1, -1, 0]


def test_strides_and_offsets_pick_interleaved_values():
    model = Model()
    rows = np.zeros(
        4, [("pad", "V8"), ("normal", "<3f4"), ("position", "<3f4"), ("uv", "<2u1"), ("end", "V2")]
    )
    rows["position"] = SQUARE
    rows["normal"] = 55
    view = model.view(
        b"\x11" * 16 + rows.tobytes()[:-4], byteStride=rows.itemsize
    )  # the last stride is cut off
    position = model.accessor(bufferView=view, byteOffset=36, componentType=5126, count=4, type="VEC3")
    indices = model.view(bytes([9, *LISTED]))
    indices = model.accessor(bufferView=indices, byteOffset=1, componentType=5121, count=6, type="SCALAR")
    model.node(mesh=model.mesh(primitive(position, indices)))
    assert (corners(model.glb()) == CORNERS).all()


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
@pytest.mark.parametrize("based", [True, False])
def test_sparse_values_replace_rows_of_a_view_or_of_zeros(dtype, based):
    model = Model()
    if based:
        position = model.array(SQUARE, "f4")
    else:
        position = model.accessor(componentType=5126, count=4, type="VEC3")
    rows, values = np.array([1, 2], f"<{dtype}"), np.array([[8, 0, 0], [8, 9, 0]], "<f4")
    model.json["accessors"][position]["sparse"] = {
        "count": 2,
        "indices": {
            "bufferView": model.view(b"ab" + rows.tobytes()),
            "byteOffset": 2,
            "componentType": {"u1": 5121, "u2": 5123, "u4": 5125}[dtype],
        },
        "values": {"bufferView": model.view(b"abcd" + values.tobytes()), "byteOffset": 4},
    }
    model.node(mesh=model.mesh(primitive(position, model.array(LISTED, "u1"))))
    expected = [[0, 0, 0], [8, 0, 0], [8, 9, 0], [0, 1, 0] if based else [0, 0, 0]]
    assert wive.load_mesh(model.glb())[0].tolist() == expected


@pytest.mark.parametrize(
    ("rows", "dtype", "expected"),
    [
        ([2, 1], "u1", "expected ascending numbers below 4"),
        ([1, 1], "u2", "expected ascending numbers below 4"),
        ([1, 4], "u4", "expected ascending numbers below 4"),
        ([1, 2], "i2", "componentType: expected unsigned integers, found 5122"),
    ],
)
def test_sparse_values_without_a_row_of_their_own_are_refused(rows, dtype, expected):
    model = Model()
    position, kind = model.array(SQUARE, "f4"), {"u1": 5121, "u2": 5123, "u4": 5125, "i2": 5122}[dtype]
    indices = {"bufferView": model.view(np.array(rows, f"<{dtype}").tobytes()), "componentType": kind}
    values = {"bufferView": model.view(np.zeros((2, 3), "<f4").tobytes())}
    model.json["accessors"][position]["sparse"] = {"count": 2, "indices": indices, "values": values}
    model.node(mesh=model.mesh(primitive(position, model.array(LISTED, "u1"))))
    assert refusal(model.glb()).startswith(f"accessors[0]: sparse: indices: {expected}")


def test_sparse_indices_of_triangles_are_read():
    model = Model()
    position, indices = model.array(SQUARE, "f4"), model.array([0, 1, 2, 0, 0, 0], "u1")
    model.json["accessors"][indices]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": model.view(bytes([4, 5])), "componentType": 5121},
        "values": {"bufferView": model.view(bytes([2, 3]))},
    }
    model.node(mesh=model.mesh(primitive(position, indices)))
    assert (corners(model.glb()) == CORNERS).all()


@pytest.mark.parametrize("required", [False, True])
def test_meshes_compressed_by_draco_are_read_from_their_plain_form_if_there_is_one(required, monkeypatch):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    model, position, indices = square()
    draco = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    model.node(mesh=model.mesh(primitive(position, indices, extensions=draco)))
    model.json["extensionsRequired"] = list(draco) * required
    assert (corners(model.glb()) == CORNERS).all()
    del model.json["accessors"][0]["bufferView"]
    with pytest.raises(ImportError) as error:
        wive.load_mesh(model.glb())
    place = "mesh (bytes): meshes[0].primitives[0]: KHR_draco_mesh_compression: needs DracoPy"
    assert str(error.value).startswith(f'{place}: pip install "wive[draco]"')


def draco_data() -> bytes:
    draco = pytest.importorskip("DracoPy")
    data: bytes = draco.encode(SQUARE, np.reshape(LISTED, (2, 3)).astype(np.uint32), quantization_bits=0)
    return data


def test_meshes_compressed_by_draco_are_unpacked():
    data = draco_data()
    # Draco has an order of its own, of triangles and of corners; each triangle winds as it did.
    assert turned(corners(compressed(data).glb())) == turned(CORNERS)


def turned(triangles: np.ndarray) -> list[list[list[float]]]:
    """The triangles in an order that does not depend on theirs, each from its least corner on."""
    corners = [triangle[at:] + triangle[:at] for triangle in triangles.tolist() for at in (0, 1, 2)]
    return sorted(corner for corner in corners if corner[0] == min(corner))


def test_draco_data_of_a_type_that_gltf_does_not_have_is_refused():
    """DracoPy gives None for their data."""
    pytest.importorskip("DracoPy")
    data = bytes.fromhex(
        "445241434f0202010000000200300101020002020101000903a90000020000004503013001100300348288040000803f0e"
    )
    assert "POSITION: its data has a type that is not read" in refusal(compressed(data).glb())


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"data": b"DRACO" + b"\1" * 59}, "KHR_draco_mesh_compression: "),
        (
            {"count": 5},
            "accessors[0]: count: expected 4, as meshes[0].primitives[0]: KHR_draco_mesh_compression has",
        ),
        (
            {"triangles": 3},
            "accessors[1]: count: expected 6, as meshes[0].primitives[0]: KHR_draco_mesh_compression",
        ),
        ({"mode": 5}, "meshes[0].primitives[0]: KHR_draco_mesh_compression: expected mode 4, triangles"),
    ],
)
def test_draco_data_that_the_document_does_not_describe_is_refused(change, expected):
    assert expected in refusal(compressed(**{"data": draco_data(), **change}).glb())
    model = compressed(draco_data())
    model.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"] = {
        "POSITION": 7
    }
    assert "KHR_draco_mesh_compression: POSITION: its data has no attribute 7" in refusal(model.glb())


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_buffers_compressed_by_meshopt_are_read_from_their_plain_form_or_refused(name):
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    model.json["bufferViews"][0]["extensions"] = {name: {"buffer": 0, "byteLength": 9, "mode": "ATTRIBUTES"}}
    assert (corners(model.glb()) == CORNERS).all()
    model.json["buffers"].append({"byteLength": 48, "extensions": {name: {"fallback": True}}})
    model.json["bufferViews"][0].update(buffer=1, byteOffset=0)
    model.json["extensionsRequired"] = [name]
    assert refusal(model.glb()).startswith(
        f"bufferViews[0]: is compressed by {name}, which is not read: export"
    )
