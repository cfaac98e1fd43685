"""Documents of glTF files: buffers, chunks and JSON as they are, or a refusal that names the place."""

import base64
import io
import json
import struct

import pytest
from support.gltf_files import (
    CORNERS,
    Model,
    chunk,
    corners,
    glb,
    primitive,
    square,
)
from support.refusals import refusal

import wive


def gltf(tmp_path, uri: str | None, blob: bytes = b"", name: str = "model.gltf", size: int | None = None):
    """A .gltf file of a square whose buffer is at `uri`."""
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    model.json["buffers"][0] = {"byteLength": len(model.blob) if size is None else size}
    if uri is not None:
        model.json["buffers"][0]["uri"] = uri.replace("BASE64", base64.b64encode(model.blob).decode())
    (tmp_path / name).write_text(json.dumps(model.json))
    return tmp_path / name, model.blob


@pytest.mark.parametrize(
    ("uri", "file"),
    [
        ("data:application/octet-stream;base64,BASE64", None),
        ("data:;base64,BASE64", None),
        ("DATA:application/gltf-buffer;charset=x;Base64,BASE64", None),
        ("square.bin", "square.bin"),
        ("./parts/a%20b%C3%A9.bin", "parts/a bé.bin"),
        ("parts\\c.bin", "parts/c.bin"),
        ("d#1?.bin", "d#1?.bin"),
    ],
)
def test_buffers_are_data_uris_or_files_in_the_folder(tmp_path, uri, file):
    path, blob = gltf(tmp_path, uri)
    if file is not None:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_bytes(blob + b"more")
    vertices, faces = wive.load_mesh(path)
    assert (vertices[faces] == CORNERS).all()


def test_percent_encoded_data_uris_are_read(tmp_path):
    path, blob = gltf(tmp_path, "")
    document = json.loads(path.read_text())
    document["buffers"][0]["uri"] = "data:," + "".join(f"%{byte:02x}" for byte in blob)
    assert (corners(json.dumps(document).encode()) == CORNERS).all()


@pytest.mark.parametrize(
    ("uri", "expected"),
    [
        ("/etc/hostname", "leads out of the file's folder"),
        ("../square.bin", "leads out of the file's folder"),
        ("a/..\\../square.bin", "leads out of the file's folder"),
        ("%2e%2e/square.bin", "leads out of the file's folder"),
        ("http://example.org/square.bin", "leads out of the file's folder"),
        ("file:///etc/hostname", "leads out of the file's folder"),
        ("C:\\square.bin", "leads out of the file's folder"),
        ("square.bin", "is missing or no ordinary file"),
        ("folder", "is missing or no ordinary file"),
        ("", "leads out of the file's folder"),
        (None, "buffers[0]: has no uri and the file has no BIN chunk"),
        ("data:;base64,AAA", "base64 data is damaged"),
        ("data:;base64", "expected data:[type][;base64],DATA"),
        ("data:;base64,AAAA", "buffers[0]: holds 3 bytes, expected its byteLength, 60"),
        ("short.bin", "buffers[0]: holds 5 bytes, expected its byteLength, 60"),
    ],
)
def test_buffers_elsewhere_missing_or_short_are_refused(tmp_path, uri, expected):
    folder = tmp_path / "inner"
    (folder / "folder").mkdir(parents=True)
    (folder / "short.bin").write_bytes(b"12345")
    path, blob = gltf(folder, uri)
    (tmp_path / "square.bin").write_bytes(blob)
    with pytest.raises(ValueError) as error:
        wive.load_mesh(path)
    assert str(error.value).startswith(f"{path}: buffers[0]: ") and expected in str(error.value)


def test_external_buffers_of_bytes_and_file_objects_are_refused(tmp_path):
    path, blob = gltf(tmp_path, "square.bin")
    (tmp_path / "square.bin").write_bytes(blob)
    assert "which bytes and file objects can't refer to: pass the path" in refusal(path.read_bytes())
    with open(path, "rb") as file, pytest.raises(ValueError, match="file objects can't refer to"):
        wive.load_mesh(file)


def test_a_huge_claim_for_an_external_buffer_is_refused_before_it_is_allocated(tmp_path):
    path, blob = gltf(tmp_path, "square.bin", size=10**12)
    (tmp_path / "square.bin").write_bytes(blob)
    with pytest.raises(ValueError, match=r"holds 60 bytes, expected its byteLength, 1000000000000"):
        wive.load_mesh(path)


def test_json_and_binary_files_are_told_by_content_and_by_name(tmp_path):
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    model.json["nodes"][0]["name"] = "é漢"
    for name in ("a.glb", "a.gltf", "a.GLB", "a.vrm"):
        (tmp_path / name).write_bytes(model.glb())
        assert len(wive.load_mesh(tmp_path / name)[1]) == 2
    uri = "data:;base64," + base64.b64encode(model.blob).decode()
    model.json["buffers"][0]["uri"] = uri
    text = json.dumps(model.json, ensure_ascii=False, indent="\t")
    for content in (text.encode(), b"\xef\xbb\xbf" + text.encode(), text.encode("utf-16")):
        assert len(wive.load_mesh(io.BytesIO(content), file_type="glb")[1]) == 2


def test_chunks_of_other_kinds_are_passed_over():
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    other = chunk(b"otherdata", 0x12345678)  # unpadded
    assert (corners(glb(model.json, model.blob, more=other)) == CORNERS).all()
    text = json.dumps(model.json).encode()
    body = chunk(text, 0x4E4F534A) + other + chunk(model.blob, 0x004E4942) + chunk(b"second", 0x004E4942)
    data = struct.pack("<4s2I", b"glTF", 2, 12 + len(body)) + body
    assert (corners(data + b"bytes after the end") == CORNERS).all()


def test_whole_numbers_may_be_written_with_a_fraction_of_zero():
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(float(position), float(indices), mode=4.0)))
    model.json["accessors"][0].update(count=4.0, componentType=5126.0, byteOffset=0.0)
    model.json["scenes"][0]["nodes"] = [0.0]
    assert (corners(model.glb()) == CORNERS).all()


def damaged_container(data: bytes) -> dict[str, tuple[bytes, str]]:
    text_end = 20 + struct.unpack_from("<I", data, 12)[0]
    return {
        "cut": (data[:-1], "header: the file should have"),
        "header": (data[:9], "header: expected 12 bytes"),
        "version 1": (data[:4] + struct.pack("<I", 1) + data[8:], "header: glTF version 1, expected 2"),
        "longer": (
            data[:8] + struct.pack("<I", 2**32 - 1) + data[12:],
            "header: the file should have 4294967295",
        ),
        "no chunk": (struct.pack("<4s2I", b"glTF", 2, 12), "header: the file has no JSON chunk"),
        "BIN first": (
            struct.pack("<4s2I", b"glTF", 2, len(data)) + data[text_end:] + data[12:text_end],
            "byte 12: expected the JSON chunk first",
        ),
        "chunk length": (
            data[:12] + struct.pack("<I", 2**31) + data[16:],
            "byte 12: a chunk ends at byte 2147483668",
        ),
        "half a chunk header": (
            data[:8] + struct.pack("<I", len(data) + 4) + data[12:] + b"abcd",
            "expected the 8 bytes of a chunk's header, found 4",
        ),
    }


@pytest.mark.parametrize("damage", list(damaged_container(b"0" * 40)))
def test_a_damaged_container_is_refused(damage):
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    data, expected = damaged_container(model.glb())[damage]
    assert refusal(data).startswith(expected) or expected in refusal(data)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"{", "JSON: expected a glTF document, found text that is no JSON"),
        (b'{"asset": NaN}', "NaN is no number of JSON"),
        (b"[" * 100_000, "JSON: "),
        (b"[]", "JSON: expected a glTF document, an object"),
        (b'{"asset": {}}', "asset: version: expected '2.0'"),
        (b'{"asset": {"version": "1.0"}}', "asset: version: expected '2.0', found '1.0'"),
        (b'{"asset": {"version": "2.5", "minVersion": "2.1"}}', "minVersion 2.1"),
        (b'{"asset": {"version": "2.0"}, "nodes": 5}', "document: nodes: expected an array, found 5"),
        (b'{"asset": {"version": "2.0"}, "scene": -1}', "document: scene: expected a whole number from 0"),
        (b'{"asset": {"version": "2.0"}, "scene": 1e999}', "document: scene: expected a whole number from 0"),
        (b'{"asset": {"version": "2.0"}, "scene": ' + b"9" * 5000 + b"}", "JSON: "),
        (b'{"asset": {"version": "2.0"}, "scene": 7}', "scene: refers to scenes[7]"),
    ],
)
def test_a_damaged_document_is_refused(text, expected):
    with pytest.raises(ValueError) as error:
        wive.load_mesh(text, file_type="gltf")
    assert expected in str(error.value) and "\n" not in str(error.value)


def change(model: Model, path: str, value: object) -> None:
    *parents, last = [int(key) if key.isdigit() else key for key in path.split("/")]
    holder = model.json
    for key in parents:
        holder = holder[key]
    if value is None:
        del holder[last]
    else:
        holder[last] = value


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("accessors/0/count", 10**12, "accessors[0]: count: expected at most 2147483647"),
        (
            "accessors/0/count",
            5,
            "accessors[0]: its 5 values end at byte 60 of bufferViews[0], expected at most 48",
        ),
        ("accessors/0/count", 3, "accessors[1]: has the index 3, expected at most 2 for 3 positions"),
        ("accessors/0/count", 4.5, "accessors[0]: count: expected a whole number from 0, found 4.5"),
        ("accessors/0/count", True, "accessors[0]: count: expected a whole number from 0, found True"),
        ("accessors/0/byteOffset", 4, "accessors[0]: its 4 values end at byte 52"),
        ("accessors/0/byteOffset", -4, "accessors[0]: byteOffset: expected a whole number from 0, found -4"),
        (
            "accessors/0/type",
            "VEC2",
            "accessors[0]: type: expected 'VEC3' for meshes[0].primitives[0]: POSITION",
        ),
        ("accessors/0/componentType", 5124, "accessors[0]: componentType: expected one of"),
        ("accessors/0/normalized", True, "accessors[0]: normalized"),
        ("accessors/0/sparse", {"count": 1}, "accessors[0]: sparse: expected an object"),
        ("accessors/0/bufferView", 9, "accessors[0]: refers to bufferViews[9], expected an index below 2"),
        (
            "accessors/1/count",
            5,
            "meshes[0].primitives[0]: mode 4: expected a multiple of 3 vertices, found 5",
        ),
        ("accessors/1/type", "VEC3", "accessors[1]: type: expected 'SCALAR'"),
        ("accessors/1/componentType", 5122, "accessors[1]: componentType: expected unsigned integers"),
        ("bufferViews/0/byteStride", 4, "bufferViews[0]: byteStride: expected at least the 12 bytes"),
        ("bufferViews/0/byteStride", 16, "accessors[0]: its 4 values end at byte 60"),
        ("bufferViews/0/byteLength", 1000, "bufferViews[0]: ends at byte 1000, expected at most 60"),
        ("bufferViews/0/buffer", 1, "bufferViews[0]: refers to buffers[1], expected an index below 1"),
        ("buffers/0/byteLength", 64, "buffers[0]: holds 60 bytes, expected its byteLength, 64"),
        ("meshes/0/primitives/0/mode", 7, "meshes[0].primitives[0]: mode: expected 0 to 6, found 7"),
        (
            "meshes/0/primitives/0/attributes/POSITION",
            8,
            "meshes[0].primitives[0]: POSITION: refers to accessors[8]",
        ),
        ("meshes/0/primitives/0/indices", "1", "meshes[0].primitives[0]: indices: expected a whole number"),
        ("meshes/0/primitives/0", 3, "meshes[0]: primitives[0]: expected an object, found 3"),
        ("meshes/0/weights", [1.0], "meshes[0].primitives[0]: targets: expected one per weight, 1, found 0"),
        ("nodes/0/mesh", 1, "nodes[0]: refers to meshes[1], expected an index below 1"),
        ("nodes/0/children", [0], "nodes[0]: is reached a second time, by nodes[0]"),
        ("nodes/0/matrix", [1, 0, 0], "nodes[0]: matrix: expected 16 finite numbers"),
        (
            "nodes/0/matrix",
            [0] * 16,
            "nodes[0]: matrix: expected finite numbers and a last row of 0 0 0 1, found 0 0 0 0",
        ),
        (
            "nodes/0",
            {"mesh": 0, "matrix": [1] * 16, "scale": [1, 1, 1]},
            "nodes[0]: has both matrix and scale",
        ),
        (
            "nodes/0/extensions",
            {"KHR_node_visibility": {"visible": 0}},
            "nodes[0]: KHR_node_visibility: visible: expected",
        ),
        ("nodes/0/extensions", [], "nodes[0]: extensions: expected an object, found []"),
        ("nodes/0/rotation", [0, 0, 0, 0], "nodes[0]: rotation: expected a quaternion of length 1"),
        ("nodes/0/scale", [10**400, 1, 1], "nodes[0]: scale: expected 3 finite numbers"),
        ("nodes/0/skin", 0, "nodes[0]: refers to skins[0]"),
        ("scenes/0/nodes", [0, 0], "nodes[0]: is reached a second time, by scenes[0]"),
        ("scenes/0/nodes", [4], "scenes[0]: refers to nodes[4]"),
        ("scene", 3, "scene: refers to scenes[3], expected an index below 1"),
        ("extensionsRequired", ["CESIUM_RTC"], "extensionsRequired: 'CESIUM_RTC' is not read"),
        ("extensionsRequired", [5], "extensionsRequired: 5 is not read"),
    ],
)
def test_what_the_document_gets_wrong_is_named(path, value, expected):
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    change(model, path, value)
    assert refusal(model.glb()).startswith(expected)
