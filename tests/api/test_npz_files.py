"""npz and npy files of meshes, rays and scenes: their arrays, or a refusal before much of them is read."""

import io
import zipfile

import numpy as np
import pytest
from support.meshes import TRIANGLE
from support.refusals import refusal

import wive
from wive._internal.archives import Archive
from wive._internal.npy_rows import FileRows
from wive._internal.npzfile import open_npy_or_npz
from wive.cli import main

VERTICES, FACES = TRIANGLE
HUGE = (10**12, 3)


def npy(array: np.ndarray, **header) -> bytes:
    """An npy file whose header may say something else than the array."""
    file = io.BytesIO()
    said = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False, "shape": array.shape}
    np.lib.format.write_array_header_2_0(file, said | header)
    return file.getvalue() + array.tobytes()


def npz(method: int = zipfile.ZIP_STORED, **members: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


def refused(data: bytes) -> str:
    return refusal(data, "npz")


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", ">f8", "<f2", "<i8", ">u2"])
@pytest.mark.parametrize("index", ["<i4", ">i8", "u1"])
@pytest.mark.parametrize("order", "CF")
@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_of_every_byte_order_and_memory_order_are_read(dtype, index, order, save):
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [4, 5, 6]], dtype, order=order)
    faces = np.array([[0, 1, 2], [1, 2, 3]], index, order=order)
    file = io.BytesIO()
    save(file, vertices=vertices, faces=faces)
    read = wive.load_mesh(file.getvalue(), np.float64)
    assert read[0].tolist() == vertices.tolist()
    assert read[1].tolist() == faces.tolist()


def test_other_members_are_not_unpacked():
    bomb = npz(zipfile.ZIP_DEFLATED, vertices=npy(VERTICES), faces=npy(FACES), bomb=bytes(1 << 20))
    start = bomb.index(b"bomb.npy") + 8
    broken = bomb[:start] + b"\xff" * 200 + bomb[start + 200 :]
    pickled = npz(vertices=npy(VERTICES), faces=npy(FACES), more=b"\x93NUMPY: no array", notes=b"text")
    for data in (bomb, broken, pickled):
        assert len(wive.load_mesh(data, file_type="npz")[1]) == len(FACES)


@pytest.mark.parametrize(
    ("vertices", "expected"),
    [
        (npy(VERTICES, shape=HUGE), "claims shape (1000000000000, 3) of float32, holds 36 bytes"),
        (npy(VERTICES, shape=(3, 2**62)), "claims shape (3, 4611686018427387904) of float32, holds 36 bytes"),
        (npy(VERTICES, shape=(-3, -3)), "claims shape (-3, -3)"),
        (npy(VERTICES[:0], shape=HUGE, descr="<U0"), "claims shape"),
        (npy(VERTICES, descr="|O"), "holds Python objects (dtype object), expected numbers"),
        (npy(VERTICES)[:-4], "claims shape (3, 3) of float32, holds 32 bytes"),
        (npy(VERTICES) + b"more", "claims shape (3, 3) of float32, holds 40 bytes"),
        (b"", "or damaged (array `vertices`: "),
        (b"\x93NUMPY\x09\x00", "or damaged (array `vertices`: "),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff{", "or damaged (array `vertices`: "),
        (b"\x93NUMPY\x01\x00\x10\x27" + b"-" * 10_000, "or damaged (array `vertices`: "),
        (b"\x93NUMPY\x01\x00\x10\x27" + b"(" * 10_000, "or damaged (array `vertices`: "),
        (npy(np.array(["a"])), "vertices must be real numbers"),
        (npy(np.zeros(3, "f4,f4,f4")), "vertices must be real numbers"),
        (npy(np.zeros(3, complex)), "vertices must be real numbers"),
    ],
)
def test_what_an_array_claims_is_checked_first(vertices, expected):
    assert expected in refused(npz(vertices=vertices, faces=npy(FACES)))


def test_arrays_are_unpacked_once_when_they_are_asked_for(monkeypatch):
    opened = []
    original = Archive.open
    monkeypatch.setattr(Archive, "open", lambda self, name: opened.append(name) or original(self, name))
    wive.load_mesh(npz(more=npy(FACES), faces=npy(FACES), vertices=npy(VERTICES)), file_type="npz")
    assert opened == ["vertices.npy", "faces.npy"]


def test_pickles_are_refused():
    file = io.BytesIO()
    np.savez(file, vertices=np.array([object()]), faces=FACES)
    assert "holds Python objects (dtype object)" in refused(file.getvalue())


def directory_entry(data: bytes, offset: int, value: bytes) -> bytes:
    at = data.index(b"PK\x01\x02") + offset
    return data[:at] + value + data[at + len(value) :]


def test_false_sizes_methods_and_checksums_of_an_archive_are_refused():
    stored = npz(vertices=npy(VERTICES), faces=npy(FACES))
    packed = npz(zipfile.ZIP_DEFLATED, vertices=npy(VERTICES), faces=npy(FACES))
    huge = b"\xf0\xff\xff\xff"
    for data in (
        directory_entry(stored, 24, huge),  # of its size
        directory_entry(packed, 24, huge),
        directory_entry(stored, 20, huge + huge),  # also of its compressed size
        directory_entry(packed, 24, b"\0\1\0\0"),
        directory_entry(stored, 16, b"abcd"),  # checksum
        directory_entry(stored, 8, b"\1\0"),  # encrypted
        directory_entry(stored, 10, b"\x63\0"),  # an unknown method
        stored[:-5],
        stored[60:],
        stored.replace(b"PK\x03\x04", b"PK\x03\x05", 1),
    ):
        assert ", or damaged (" in refused(data)
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        data = npz(method, vertices=npy(VERTICES), faces=npy(FACES))
        assert f"array `vertices`: compressed by method {method}, expected stored or deflated" in refused(
            data
        )


def test_a_scene_file_with_false_claims_is_refused(tmp_path):
    path = tmp_path / "scene.npz"
    wive.Scene(VERTICES, FACES).save(path)
    with np.load(path) as saved:
        header = npy(saved["header"])
    path.write_bytes(npz(header=header, vertices=npy(VERTICES, shape=HUGE), faces=npy(FACES)))
    with pytest.raises(ValueError, match="not a scene saved by wive, or damaged") as error:
        wive.load(path)
    assert str(error.value).startswith(f"{path}: ")
    nested = np.array("[" * 100_000)
    path.write_bytes(npz(header=npy(nested), vertices=npy(VERTICES), faces=npy(FACES), more=b"?"))
    with pytest.raises(ValueError, match="not a scene saved by wive"):
        wive.load(path)


def test_ray_files_with_false_claims_are_refused(tmp_path, capsys):
    mesh, rays, hits = tmp_path / "mesh.npz", tmp_path / "rays.npy", tmp_path / "hits.npz"
    np.savez(mesh, vertices=VERTICES, faces=FACES)
    ray = np.zeros((1, 6))
    for data in (npy(ray, shape=(10**12, 6)), npy(ray)[:-1], npy(ray, descr="|O"), npz(origins=npy(ray))):
        rays.write_bytes(data)
        assert main(["trace", str(mesh), str(rays), "-o", str(hits)]) == 2
        assert f"{rays}: not a file of rays" in capsys.readouterr().err
    assert not hits.exists()


@pytest.mark.parametrize("order", "CF")
def test_a_large_array_is_read_whole(tmp_path, order):
    array = np.asarray(np.random.default_rng(1).random((100_000, 6)), order=order)
    np.save(tmp_path / "rays.npy", array)
    with open_npy_or_npz(tmp_path / "rays.npy", "a file of rays") as read:
        assert isinstance(read, FileRows) and (read.read(len(array)) == array).all()


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_an_archive_behind_other_bytes_is_read(tmp_path, method):
    rays = np.random.default_rng(2).random((1000, 3), np.float32)
    data = npz(method, origins=npy(rays), directions=npy(rays[::-1]))
    (tmp_path / "rays.npz").write_bytes(b"#!/bin/sh\n" * 10 + data)
    with open_npy_or_npz(tmp_path / "rays.npz", "a file of rays") as read:
        rows = read.rows("directions")
        rows.skip(10)
        np.testing.assert_array_equal(rows.read(990), rays[::-1][10:])
        rows.close()
        np.testing.assert_array_equal(read["origins"], rays)


def test_what_is_skipped_counts_in_the_checksum(tmp_path):
    data = bytearray(npz(origins=npy(np.ones((100_000, 3)))))
    data[1000] ^= 1
    (tmp_path / "rays.npz").write_bytes(data)
    with open_npy_or_npz(tmp_path / "rays.npz", "a file of rays") as read:
        rows = read.rows("origins")
        rows.skip(99_999)
        with pytest.raises(ValueError, match=r"rays\.npz: not a file of rays, or damaged .*CRC"):
            rows.read(1)
        rows.close()
