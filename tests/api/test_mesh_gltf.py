"""glTF files: triangles are the document's in its order and place, or the file is refused."""

import base64
import io
import json
import struct
import sys

import numpy as np
import pytest
from support.gltf_files import Model, chunk, compressed, glb, primitive

import wive

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
LISTED = [0, 1, 2, 0, 2, 3]
CORNERS = SQUARE[LISTED].reshape(2, 3, 3)


def square(dtype: str = "u2") -> tuple[Model, int, int]:
    """A model with a square's positions and indices, in accessors 0 and 1, and no mesh."""
    model = Model()
    return model, model.array(SQUARE, "f4"), model.array(LISTED, dtype)


def corners(data: bytes, dtype=np.float64) -> np.ndarray:
    vertices, faces = wive.load_mesh(data, dtype)
    return vertices[faces]


def refusal(data: bytes) -> str:
    with pytest.raises(ValueError) as error:
        wive.load_mesh(data)
    text = str(error.value)
    assert "\n" not in text and text.startswith("mesh (bytes): ")
    return text.removeprefix("mesh (bytes): ")


def test_triangles_come_in_the_order_of_nodes_primitives_and_indices():
    model, position, indices = square()
    far = model.array(np.add(SQUARE, [0, 0, 100]), "f4")
    near, two = (
        model.mesh(primitive(position, indices)),
        model.mesh(primitive(far, indices), primitive(position, indices)),
    )
    child = model.node(root=False, mesh=near, translation=[0, 0, 2])
    model.node(mesh=near, translation=[0, 0, 9])
    model.node(mesh=near, translation=[0, 0, 1], children=[child])
    model.node(mesh=two)
    vertices, faces = wive.load_mesh(model.glb())
    assert vertices[faces][::2, 0, 2].tolist() == [9, 1, 3, 100, 0]
    assert len(vertices) == 5 * 4  # nothing merged
    assert faces[:, 0].tolist() == [4 * (at // 2) for at in range(10)]


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
def test_indices_of_every_width_are_read(dtype):
    model, position, indices = square(dtype)
    model.node(mesh=model.mesh(primitive(position, indices)))
    vertices, faces = wive.load_mesh(model.glb())
    assert vertices.tolist() == SQUARE.tolist()
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_vertices_that_no_triangle_uses_and_degenerate_triangles_stay():
    model = Model()
    position = model.array(np.vstack([[[7, 7, 7]], SQUARE]), "f4")
    model.node(mesh=model.mesh(primitive(position, model.array([1, 2, 3, 2, 2, 2], "u1"))))
    vertices, faces = wive.load_mesh(model.glb())
    assert len(vertices) == 5
    assert faces.tolist() == [[1, 2, 3], [2, 2, 2]]


def test_strips_and_fans_are_taken_apart_as_the_specification_has_it():
    model = Model()
    position = model.array(np.arange(18).reshape(6, 3), "f4")
    strip = primitive(position, model.array([5, 0, 1, 2, 3], "u1"), mode=5)
    fan = primitive(position, mode=6)
    model.node(mesh=model.mesh(strip, fan))
    faces = wive.load_mesh(model.glb())[1]
    assert faces[:3].tolist() == [[5, 0, 1], [0, 2, 1], [1, 2, 3]]
    assert (faces[3:] - 6).tolist() == [[1, 2, 0], [2, 3, 0], [3, 4, 0], [4, 5, 0]]


def test_a_primitive_without_indices_is_a_list_of_its_positions():
    model = Model()
    model.node(mesh=model.mesh(primitive(model.array(SQUARE[LISTED], "f4"))))
    vertices, faces = wive.load_mesh(model.glb())
    assert faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert (vertices[faces] == CORNERS).all()


def test_points_and_lines_and_primitives_without_positions_have_no_triangles():
    model, position, indices = square()
    others = [primitive(position, indices, mode=mode) for mode in (0, 1, 2, 3)]
    model.node(mesh=model.mesh(*others, {"attributes": {}}, primitive(position, indices)))
    assert len(wive.load_mesh(model.glb())[0]) == 4
    model.json["meshes"][0]["primitives"].pop()
    assert "has no triangles" in refusal(model.glb())


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


def test_matrices_of_nodes_are_multiplied_in_double_precision():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    turn = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]  # a quarter about z
    inner = model.node(root=False, mesh=mesh, scale=[2, 3, 4])
    middle = model.node(root=False, rotation=turn, children=[inner])
    column_major = [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 1e8, 5, 6, 1]  # y to z, z to -y
    model.node(matrix=column_major, children=[middle])
    x, y = SQUARE.astype(np.float64).T[:2] * [[2], [3]]
    expected = np.stack([-y + 1e8, 0 * x + 5, x + 6], axis=1)
    assert np.abs(wive.load_mesh(model.glb(), np.float64)[0] - expected).max() < 1e-7


def test_normals_of_mirrored_meshes_point_outwards():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    once = model.node(root=False, mesh=mesh, scale=[-1, 1, 1])
    model.node(mesh=mesh)
    model.node(children=[once])
    twice = model.node(root=False, mesh=mesh, scale=[1, -1, 1])
    model.node(scale=[-1, 1, 1], children=[twice])
    vertices, faces = wive.load_mesh(model.glb())
    assert faces.tolist()[2:4] == [[4, 6, 5], [4, 7, 6]]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_vertices_shared_by_two_primitives_are_placed_alike():
    model = Model()
    points = np.random.default_rng(1).normal(size=(1000, 3)).astype(np.float32)
    first, second = model.array(points, "f4"), model.array(points[17:500], "f4")
    indices = model.array(np.arange(483) // 3 * 3, "u2")
    rotation = [0.18257419, 0.36514837, 0.54772256, 0.73029674]
    model.node(
        mesh=model.mesh(primitive(first, indices), primitive(second, indices)),
        rotation=rotation,
        translation=[0.1, 1e5, 3],
    )
    vertices = wive.load_mesh(model.glb(), np.float64)[0]
    assert (vertices[17:500] == vertices[1000:]).all()


def test_the_default_scene_is_read_or_the_first_one_or_all_roots():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    child = model.node(root=False, mesh=mesh, translation=[0, 0, 1])
    for z in (10, 20):
        model.node(root=False, mesh=mesh, translation=[0, 0, z])
    model.node(root=False, children=[child])
    model.json["scenes"] = [{"nodes": [2]}, {"nodes": [1]}]
    seen = {}
    for name, change in {"1": {"scene": 1}, "0": {"scene": 0}, "none": {"scene": None}}.items():
        model.json.update(change)
        if model.json["scene"] is None:
            del model.json["scene"]
        seen[name] = corners(model.glb())[::2, 0, 2].tolist()
    del model.json["scenes"]
    seen["no scenes"] = corners(model.glb())[::2, 0, 2].tolist()
    assert seen == {"1": [10], "0": [20], "none": [20], "no scenes": [10, 20, 1]}
    del model.json["nodes"]
    assert (corners(model.glb()) == CORNERS).all()


def test_instances_on_the_gpu_are_instances():
    model, position, indices = square()
    instancing = {
        "TRANSLATION": model.array([[0, 0, 1], [0, 0, 2], [0, 0, 3]], "f4"),
        "ROTATION": model.array([[0, 0, 0, 127], [127, 0, 0, 0], [0, 0, 0, 127]], "i1", normalized=True),
        "SCALE": model.array([[1, 1, 1], [1, 1, 1], [-2, 2, 2]], "f4"),
    }
    model.node(
        mesh=model.mesh(primitive(position, indices)),
        translation=[100, 0, 0],
        extensions={"EXT_mesh_gpu_instancing": {"attributes": instancing}},
    )
    model.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    vertices, faces = wive.load_mesh(model.glb())
    expected = [
        np.add(SQUARE, [100, 0, 1]),
        SQUARE * [1, -1, 1] + [100, 0, 2],
        SQUARE * [-2, 2, 2] + [100, 0, 3],
    ]
    assert vertices.tolist() == np.concatenate(expected).tolist()
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 10, 9], [8, 11, 10]]


def test_default_weights_move_morph_targets():
    model, position, indices = square()
    up, aside = model.array(SQUARE * 0 + [0, 0, 1], "f4"), model.array(SQUARE * 0 + [1, 0, 0], "f4")
    targets = [{"POSITION": up}, {"NORMAL": up}, {"POSITION": aside}]
    mesh = model.mesh(primitive(position, indices, targets=targets), weights=[0.5, 1, 0])
    model.node(mesh=mesh)
    model.node(mesh=mesh, weights=[0, 0, 2])
    model.node(mesh=mesh, weights=[0, 0, 0])
    vertices = wive.load_mesh(model.glb())[0]
    assert (
        vertices.tolist()
        == np.concatenate([np.add(SQUARE, [0, 0, 0.5]), np.add(SQUARE, [2, 0, 0]), SQUARE]).tolist()
    )


def test_skins_are_in_the_pose_of_their_joints():
    model, position, indices = square()
    joints = model.array([[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 9, 9]], "u1")
    weights = model.array(
        [[255, 0, 0, 0], [255, 0, 0, 0], [255, 0, 0, 0], [51, 204, 0, 0]], "u1", normalized=True
    )
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, :3, 3] = [0, 0, -3]
    bound = model.array(bind.transpose(0, 2, 1).reshape(2, 16), "f4")
    attributes = {"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights}
    mesh = model.mesh({"attributes": attributes, "indices": indices})
    tip = model.node(root=False, translation=[0, 0, 5])
    hip = model.node(translation=[0, 0, 1], children=[tip])
    model.json["skins"] = [{"joints": [hip, tip], "inverseBindMatrices": bound}]
    model.node(mesh=mesh, skin=0, translation=[1000, 0, 0])  # has no say: joints do
    vertices = wive.load_mesh(model.glb(), np.float64)[0]
    assert np.abs(vertices - np.add(SQUARE, [[0, 0, 1], [0, 0, 3], [0, 0, 3], [0, 0, 2.6]])).max() < 1e-12


def test_instances_with_attributes_of_their_own_alone_are_copies_in_place():
    model, position, indices = square()
    instancing = {"attributes": {"_ID": model.array([5, 6, 7], "u2")}}
    mesh = model.mesh(primitive(position, indices))
    model.node(mesh=mesh, extensions={"EXT_mesh_gpu_instancing": instancing})
    assert corners(model.glb()).tolist() == np.tile(CORNERS, (3, 1, 1)).tolist()
    instancing["attributes"]["SCALE"] = model.array(np.ones((2, 3)), "f4")
    assert "EXT_mesh_gpu_instancing: expected attributes of one count, found [2, 3]" in refusal(model.glb())


def test_hidden_nodes_are_left_out():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    child = model.node(root=False, mesh=mesh)
    hidden = {"KHR_node_visibility": {"visible": False}}
    model.node(mesh=mesh, children=[child], extensions=hidden)
    model.node(mesh=mesh, translation=[0, 0, 4], extensions={"KHR_node_visibility": {}})
    assert corners(model.glb())[:, 0, 2].tolist() == [4, 4]


def test_a_chain_of_a_hundred_thousand_nodes_is_read():
    model, position, indices = square()
    model.json["nodes"] = [{"children": [at + 1]} for at in range(100_000)]
    model.json["nodes"][99]["translation"] = [0, 0, 5]
    model.json["nodes"].append({"mesh": model.mesh(primitive(position, indices))})
    model.json["scenes"][0]["nodes"] = [0]
    assert (corners(model.glb()) == np.add(CORNERS, [0, 0, 5])).all()


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
        ("nodes/0/matrix", [0] * 16, "nodes[0]: matrix: expected a last row of 0 0 0 1"),
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


def test_nodes_with_two_parents_or_in_a_circle_are_refused():
    model, position, indices = square()
    shared = model.node(root=False, mesh=model.mesh(primitive(position, indices)))
    model.node(children=[shared])
    model.node(children=[shared])
    assert refusal(model.glb()).startswith("nodes[0]: is reached a second time, by nodes[2]")
    model.json["nodes"] = [{"children": [1]}, {"children": [0]}]
    del model.json["scenes"], model.json["scene"]
    assert refusal(model.glb()).startswith("nodes: each is a child of another")


@pytest.mark.parametrize(("dtype", "restart"), [("u1", 255), ("u2", 65535), ("u4", 2**32 - 1)])
def test_primitive_restart_is_refused(dtype, restart):
    model = Model()
    position = model.array(np.zeros((70_000, 3)), "f4")
    strip = primitive(position, model.array([0, 1, 2, restart, 3, 4, 5], dtype), mode=5)
    model.node(mesh=model.mesh(strip))
    assert refusal(model.glb()).startswith(
        f"accessors[1]: has the index {restart}, which restarts a primitive"
    )


def test_copies_beyond_the_range_of_indices_are_refused_before_they_are_made():
    model = Model()
    position = model.accessor(componentType=5126, count=3_000_000, type="VEC3")
    mesh = model.mesh(primitive(position))
    for _ in range(1000):
        model.node(mesh=mesh)
    assert refusal(model.glb()).startswith("scene: has 3000000000 vertices and 1000000000 triangles")


@pytest.mark.parametrize(
    "name", ["KHR_materials_unlit", "KHR_texture_basisu", "EXT_texture_webp", "KHR_lights_punctual"]
)
def test_required_extensions_of_materials_and_lights_change_nothing(name):
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices, extensions={name: {}}), extensions={name: {}}))
    model.json["extensionsRequired"] = [name]
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


def test_what_the_scene_does_not_use_may_be_anything():
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    model.json["accessors"].append({"count": -1})
    model.json["bufferViews"].append(None)
    model.json["meshes"].append({"primitives": 3})
    model.json["nodes"].append({"mesh": 99})
    model.json["buffers"].append({"uri": "../animation.bin", "byteLength": 10**15})
    assert (corners(model.glb()) == CORNERS).all()
