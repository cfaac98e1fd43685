"""Mesh files that are cut off or claim too much: a mesh, or one line that names the file, nothing else."""

import io
import tracemalloc
import zipfile

import pytest
from support.gltf_files import primitive, square
from support.mesh_files import TRIANGLE, WHOLE, npz, ply_binary, ply_text, stl_binary
from support.refusals import load_or_refusal

import wive
from wive import meshfile


@pytest.mark.parametrize("kind", WHOLE)
def test_every_truncation_is_read_or_refused(kind):
    for whole in WHOLE[kind]:
        for size in range(0, len(whole), 1 if len(whole) < 400 else 3):
            load_or_refusal(whole[:size], kind)


def many_nodes(count: int) -> bytes:
    """A glTF model whose nodes all draw one mesh with as many targets, by a skin of as many joints."""
    model, position, indices = square()
    weights = model.array([[1, 0, 0, 0]] * 4, "f4")
    mesh = primitive(position, indices, targets=[{}] * count)
    mesh["attributes"] |= {"JOINTS_0": model.array([[0] * 4] * 4, "u1"), "WEIGHTS_0": weights}
    number = model.mesh(mesh)
    for _ in range(count):
        model.node(mesh=number, skin=0, weights=[])
    model.json["skins"] = [{"joints": list(range(count))}]
    return model.glb()


def npz_claiming(shape: tuple[int, ...]) -> bytes:
    """An npz file whose vertices claim a shape that their bytes don't have."""
    claim = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}".encode()
    claim += b" " * (-len(claim) % 64) + b"\n"
    file = io.BytesIO(npz())
    with zipfile.ZipFile(file) as archive:
        faces = archive.read("faces.npy")
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "vertices.npy", b"\x93NUMPY\x01\0" + len(claim).to_bytes(2, "little") + claim + b"\0" * 36
        )
        archive.writestr("faces.npy", faces)
    return file.getvalue()


HUGE = b"1000000000000"


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("ply", ply_text().replace(b"vertex 5", b"vertex " + HUGE)),
        ("ply", ply_binary().replace(b"vertex 5", b"vertex " + HUGE)),
        ("ply", ply_binary().replace(b"face 2", b"face " + HUGE)),
        ("ply", ply_binary().replace(b"edge 1", b"edge " + HUGE)),
        ("ply", ply_binary().replace(b"vertex 5", b"vertex " + b"9" * 5000)),
        ("ply", ply_binary().replace(b"vertex 5", b"vertex -5")),
        ("ply", ply_binary(count="uint").replace(b"\4\0\0\0\0\0\0\0", b"\xff\xff\xff\xff\0\0\0\0")),
        ("ply", ply_binary(count="int").replace(b"\4\0\0\0\0\0\0\0", b"\xff\xff\xff\xff\0\0\0\0")),
        ("ply", ply_text().replace(b"4 0 1", HUGE + b" 0 1")),
        ("off", b"OFF\n" + HUGE + b" 1 0\n0 0 0\n3 0 0 0\n"),
        ("off", b"OFF\n1 1 0\n0 0 0\n9223372036854775807 0 0 0\n"),
        ("off", b"OFF\n-1 3 0\n0 0 0\n3 0 0 0\n"),
        ("stl", stl_binary(2, count=2**32 - 1)),
        ("npz", npz_claiming((10**12, 3))),
        ("npz", npz_claiming((-1, -3))),
        ("npz", npz_claiming((0, 10**30))),
        ("npz", npz_claiming((3,))),
    ],
)
def test_claims_beyond_the_file_are_refused_before_memory_is_taken(kind, data):
    wive.load_mesh(WHOLE[kind][0], file_type=kind)  # what is imported and kept
    tracemalloc.start()
    assert load_or_refusal(data, kind) != ""
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2_000_000


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("obj", b"v " * 300_000),
        ("obj", b"v " + b"1" * 300_000 + b" 0 0\n" + TRIANGLE + b"f 2 3 4"),
        ("obj", b"v 16777217." + b"0" * 300_000 + b"1 0 0\n" + TRIANGLE + b"f 2 3 4"),
        ("obj", TRIANGLE + b"f " + b"1 2 3 " * 200_000),
        ("obj", TRIANGLE + b"f 1/" + b"/" * 300_000 + b" 2 3"),
        ("obj", TRIANGLE + b"g " + b"\\" * 300_000 + b"x\nf 1 2 3"),
        ("obj", TRIANGLE + b"g " + b"\\ " * 300_000 + b"\nf 1 2 3"),
        ("obj", TRIANGLE + b"\\\n" * 100_000 + b"f 1 2 3"),
        ("stl", b"solid " * 300_000),
        ("stl", b"solid\n" * 100_000),
        ("stl", (b"end" + b" " * 5000 + b"olid\n") * 100),
        ("glb", many_nodes(8000)),
        ("stl", b"solid a facet normal 0 0 1 endsolid a " * 50_000),
        ("off", b" " * 300_000 + b"OFF"),
        ("ply", ply_text().replace(b"comment x\n", b"comment\n" * 100_000)),
        (
            "ply",
            ply_text().replace(b"end_h", b"".join(b"element e%d 0\n" % i for i in range(30_000)) + b"end_h"),
        ),
    ],
)
@pytest.mark.timeout(60)  # if time grows with the square of the size, these take longer
def test_no_file_takes_time_beyond_its_size(kind, data):
    load_or_refusal(data, kind)


@pytest.mark.parametrize("kind", WHOLE)
def test_more_vertices_than_a_scene_numbers_are_refused(kind, monkeypatch):
    monkeypatch.setattr(meshfile, "MOST", 2)  # in place of 2**31 - 1
    for whole in WHOLE[kind]:
        assert load_or_refusal(whole, kind).endswith(" vertices, more than 2: split the file")
