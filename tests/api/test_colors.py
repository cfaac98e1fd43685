"""Colours of mesh files, beside the triangles and vertices that they are of."""

import json
import struct

import numpy as np
import pytest

import wive
from wive._internal.formats.colours import linear

RED, GREEN, BLUE = (255, 0, 0), (0, 255, 0), (0, 0, 255)
PLY = """ply
format {form} 1.0
element vertex 4
property float x
property float y
property float z
{of_vertices}element face 2
property list uchar int vertex_indices
{of_faces}end_header
"""
CHANNELS = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


def signs(colours: np.ndarray) -> list:
    return np.sign(colours).reshape(-1, 3).astype(int).tolist()


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_colours_of_vertices(tmp_path, form):
    header = PLY.format(form=form, of_vertices=CHANNELS, of_faces="")
    colours = [RED, GREEN, BLUE, (255, 255, 255)]
    if form == "ascii":
        rows = [f"{x} {y} {z} {r} {g} {b}" for (x, y, z), (r, g, b) in zip(CORNERS, colours, strict=True)]
        body = "\n".join([*rows, "3 0 1 2", "3 0 2 3", ""]).encode()
    else:
        order = "<" if "little" in form else ">"
        body = b"".join(struct.pack(f"{order}3f3B", *at, *c) for at, c in zip(CORNERS, colours, strict=True))
        body += b"".join(struct.pack(f"{order}B3i", 3, *face) for face in ((0, 1, 2), (0, 2, 3)))
    (tmp_path / "a.ply").write_bytes(header.encode() + body)
    found = wive.load_colors(tmp_path / "a.ply")
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, 0.8 * np.array(colours) / 255, rtol=1e-6)
    assert wive.load_mesh(tmp_path / "a.ply")[0].shape == found.shape


def test_ply_colours_of_faces_are_those_of_each_triangle_of_a_polygon():
    text = PLY.format(form="ascii", of_vertices="", of_faces=CHANNELS)
    rows = [" ".join(map(str, corner)) for corner in CORNERS]
    data = (text + "\n".join([*rows, "4 0 1 2 3 255 0 0", "3 0 1 2 0 0 255", ""])).encode()
    found = wive.load_colors(data)
    assert found.shape == (3, 1, 3) == (len(wive.load_mesh(data)[1]), 1, 3)
    assert signs(found) == [[1, 0, 0], [1, 0, 0], [0, 0, 1]]


def test_ply_colours_of_wider_types_are_shares_of_their_largest_number():
    half = linear(np.array([0.5]), 1)[0]
    for kind, number in (("ushort", 32768), ("float", 0.5), ("double", 127.5)):
        channels = CHANNELS.replace("uchar", kind)
        text = PLY.format(form="ascii", of_vertices=channels, of_faces="")
        most = {"ushort": 65535, "float": 1, "double": 255}[kind]
        rows = [f"{x} {y} {z} {number} 0 {most}" for x, y, z in CORNERS]
        found = wive.load_colors((text + "\n".join([*rows, "3 0 1 2", "3 0 2 3", ""])).encode())
        np.testing.assert_allclose(found, np.tile([0.8 * half, 0, 0.8], (4, 1)), rtol=1e-4)


def test_off_colours_of_vertices_and_faces():
    vertices = "0 0 0 {}\n1 0 0 {}\n1 1 0 {}\n"
    coloured = "COFF\n3 1 0\n" + vertices.format("255 0 0 255", "0 255 0 255", "0 0 255 255") + "3 0 1 2\n"
    assert signs(wive.load_colors(coloured.encode())) == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    shares = "CNOFF\n3 1 0\n" + vertices.format("0 0 1 1 0 0", "0 0 1 0 1 0", "0 0 1 0 0 1") + "3 0 1 2\n"
    assert signs(wive.load_colors(shares.encode())) == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    faces = "OFF\n3 3 0\n" + vertices.format("", "", "") + "3 0 1 2 0 1 0\n3 0 1 2\n3 0 2 1 1 0 0 1\n"
    found = wive.load_colors(faces.encode())
    np.testing.assert_allclose(found[:, 0], [[0, 0.8, 0], [0.6, 0.6, 0.6], [0.8, 0, 0]], rtol=1e-6)


def test_obj_colours_of_vertices():
    text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nf 1 2 3\n"
    assert signs(wive.load_colors(text.encode())) == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert wive.load_colors(b"v 0 0 0 1\nv 1 0 0 1\nv 1 1 0 1\nf 1 2 3\n") is None  # weights


def test_obj_colours_of_materials(tmp_path):
    (tmp_path / "my colours.mtl").write_text(
        "newmtl red one\nKd 1 0 0\nmap_Kd x.png\nnewmtl b\nKd 0 0 1\nKd spectral x\n"
    )
    text = "mtllib my colours.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nusemtl red one\nf 1 2 3 4\n"
    text += "usemtl b # blue\nf 1 2 4\nusemtl unknown\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(text)
    found = wive.load_colors(tmp_path / "a.obj")
    assert found.shape == (len(wive.load_mesh(tmp_path / "a.obj")[1]), 1, 3)
    grey = [0.6] * 3
    np.testing.assert_allclose(found[:, 0], [grey, [0.8, 0, 0], [0.8, 0, 0], [0, 0, 0.8], grey], rtol=1e-6)


@pytest.mark.parametrize("name", ["../m.mtl", "/etc/passwd", "missing.mtl", "", "sub/../../m.mtl"])
def test_material_files_are_looked_for_below_the_meshs_folder_alone(tmp_path, name):
    folder = tmp_path / "inner"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "m.mtl").write_text("newmtl b\nKd 0 0 1\n")
    (folder / "a.obj").write_text(f"mtllib {name}\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl b\nf 1 2 3\n")
    assert wive.load_colors(folder / "a.obj") is None


def gltf(primitive: dict, materials: list, extra: bytes = b"", accessors: tuple = ()) -> bytes:
    """A .glb of two copies of a triangle, and one more with no material."""
    positions = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]).tobytes()
    binary = positions + extra
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}, {"mesh": 1}, {"mesh": 0, "translation": [2, 0, 0]}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0}, **primitive}]},
            {"primitives": [{"attributes": {"POSITION": 0}}]},
        ],
        "materials": materials,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            *accessors,
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(extra)},
        ],
        "buffers": [{"byteLength": len(binary)}],
    }
    if not extra:
        document["bufferViews"].pop()
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = (
        struct.pack("<II", len(text), 0x4E4F534A)
        + text
        + struct.pack("<II", len(binary), 0x004E4942)
        + binary
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_gltf_colours_are_the_factor_times_those_of_vertices_for_each_copy():
    factor = [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0.25, 1]}}]
    plain = gltf({"material": 0}, factor)
    expected = 0.8 * np.repeat([[0.5, 1, 0.25], [1, 1, 1], [0.5, 1, 0.25]], 3, axis=0)
    np.testing.assert_allclose(wive.load_colors(plain), expected, rtol=1e-6)
    assert wive.load_mesh(plain)[0].shape == expected.shape
    bytes_of = np.uint8([[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]]).tobytes()
    accessor = {"bufferView": 1, "componentType": 5121, "normalized": True, "count": 3, "type": "VEC4"}
    mixed = gltf({"attributes": {"POSITION": 0, "COLOR_0": 1}, "material": 0}, factor, bytes_of, (accessor,))
    np.testing.assert_allclose(wive.load_colors(mixed)[:3], 0.8 * np.diag([0.5, 1, 0.25]), rtol=1e-6)


def test_files_without_colours_have_none(tmp_path):
    np.savez(tmp_path / "a.npz", vertices=CORNERS, faces=[[0, 1, 2]])
    assert wive.load_colors(tmp_path / "a.npz") is None
    assert wive.load_colors(b"OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2\n") is None
    assert wive.load_colors(b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n") is None
    assert wive.load_colors(gltf({"material": 0}, [{}])) is None
    text = PLY.format(form="ascii", of_vertices="", of_faces="")
    assert wive.load_colors(text.encode()) is None


def test_a_file_that_is_missing_or_damaged_is_one_line(tmp_path):
    with pytest.raises(OSError, match="no such file"):
        wive.load_colors(tmp_path / "a.ply")
    cut = PLY.format(form="binary_little_endian", of_vertices=CHANNELS, of_faces="").encode()
    with pytest.raises(ValueError, match="mesh \\(bytes\\): "):
        wive.load_colors(cut)


def test_colours_of_a_file_are_an_albedo(tmp_path):
    text = "v 0 0 0 1 0 0\nv 4 0 0 1 0 0\nv 4 4 0 1 0 0\nf 1 2 3\n"
    picture = wive.render(
        wive.Scene.from_file(text.encode(), file_type="obj"),
        wive.Camera((3, 2, 5), (3, 1, 0), fov=5),
        shading="headlight", albedo=wive.load_colors(text.encode()), width=8, height=8, spp=4,
    )  # fmt: skip
    assert (picture[..., 0] > 0.7).all() and (picture[..., 1:] == 0).all()
