"""Mesh files as paths, bytes and file objects, and how their format is told."""

import gzip
import io
import pathlib
import tempfile

import numpy as np
import pytest
from support.mesh_files import OBJ, WHOLE

import wive


@pytest.mark.parametrize("kind", WHOLE)
def test_paths_bytes_and_file_objects_give_the_same_mesh(kind, tmp_path):
    for data in WHOLE[kind]:
        expected = wive.load_mesh(data, np.float64, file_type=kind)
        path = tmp_path / f"mesh.{kind.upper()}"
        path.write_bytes(data)
        with open(path, "rb") as file:
            sources = [path, str(path), bytearray(data), memoryview(data), io.BytesIO(data), file]
            for source in sources:
                named = isinstance(source, str | pathlib.Path) or source is file
                found = wive.load_mesh(source, np.float64, file_type=None if named else f".{kind.upper()}")
                for array, same in zip(found, expected, strict=True):
                    np.testing.assert_array_equal(array, same)
        assert len(wive.Scene.from_file(data, file_type=kind)) == len(expected[1])
        assert len(wive.Scene.from_file(path, accuracy="fast")) == len(expected[1])


@pytest.mark.parametrize("kind", WHOLE)
def test_content_tells_its_format(kind, tmp_path):
    for data in WHOLE[kind]:
        path = tmp_path / "mesh"
        path.write_bytes(data)
        expected = wive.load_mesh(data, file_type=kind)[1]
        for source in (path, data, io.BytesIO(data)):
            np.testing.assert_array_equal(wive.load_mesh(source)[1], expected)


def test_a_file_object_is_read_from_where_it_stands_and_stays_open():
    file = io.BytesIO(b"before" + OBJ)
    file.seek(6)
    assert len(wive.load_mesh(file, file_type="obj")[1]) == 6
    assert file.read() == b"" and not file.closed


def test_file_objects_of_other_kinds(tmp_path):
    with tempfile.TemporaryFile() as file:
        file.write(OBJ)
        file.seek(0)
        assert len(wive.load_mesh(file)[1]) == 6
    with gzip.open(tmp_path / "mesh.obj.gz", "wb") as file:
        file.write(OBJ)
    with gzip.open(tmp_path / "mesh.obj.gz") as file:
        assert len(wive.load_mesh(file, file_type="obj")[1]) == 6
    assert len(wive.load_mesh(io.StringIO(OBJ.decode()), file_type="obj")[1]) == 6


def test_errors_name_the_source(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_bytes(b"f 1 2 3")
    with open(path, "rb") as file:
        for source, name in ((path, path), (file, path), (b"f 1 2 3", "mesh (bytes)")):
            with pytest.raises(ValueError) as error:
                wive.load_mesh(source, file_type="obj")
            assert str(error.value).startswith(f"{name}: line 1: expected an index")
    with pytest.raises(ValueError, match=r"^mesh \(file object\): is empty$"):
        wive.load_mesh(io.BytesIO())


@pytest.mark.parametrize("source", [None, 5, [1, 2], object()])
def test_what_is_no_source_is_refused(source):
    with pytest.raises(TypeError, match=r"^source must be a path, bytes or a file object, got"):
        wive.load_mesh(source)


def test_what_reads_no_bytes_is_refused():
    class Broken:
        def read(self) -> int:
            return 5

    with pytest.raises(TypeError, match=r"^source.read\(\) must return bytes, got int"):
        wive.load_mesh(Broken())


@pytest.mark.parametrize("file_type", ["", ".", 5, b"obj"])
def test_what_is_no_format_is_refused(file_type):
    with pytest.raises(ValueError, match=r"^file_type must be a format such as 'ply', got"):
        wive.load_mesh(OBJ, file_type=file_type)


def test_unknown_content_asks_for_its_format(tmp_path):
    path = tmp_path / "mesh"
    path.write_bytes(b"hello world")
    with pytest.raises(ValueError, match="nothing tells its format: pass file_type, such as 'ply'"):
        wive.load_mesh(path)


def test_npz_arrays_may_have_any_order_and_integer_dtype():
    vertices = np.asfortranarray(np.random.default_rng(2).normal(size=(7, 3)).astype(">f8"))
    for dtype in ("u1", ">i2", "u4", "i8", ">u8"):
        faces = np.asfortranarray(np.array([[0, 1, 2], [6, 5, 4]], dtype))
        file = io.BytesIO()
        np.savez_compressed(file, vertices=vertices, faces=faces)
        for found, given in zip(wive.load_mesh(file.getvalue(), np.float64), (vertices, faces), strict=True):
            np.testing.assert_array_equal(found, given)
            assert found.flags.c_contiguous and found.dtype.isnative


@pytest.mark.parametrize(
    ("vertices", "faces", "expected"),
    [
        (np.eye(3), [[0, 1, 3]], "triangle 0 must index the 3 vertices from 0, got [0, 1, 3]"),
        (np.eye(3), [[0, 1, 2], [0, -1, 2]], "triangle 1 must index the 3 vertices from 0, got [0, -1, 2]"),
        (np.eye(3), [[0, 1, 2**40]], "triangle 0 must index the 3 vertices from 0"),
        (np.eye(3), [[0.0, 1.0, 2.0]], "faces must be integers, got dtype float64"),
        (np.eye(3), [["a", "b", "c"]], "faces must be integers, got dtype <U1"),
        (np.eye(3) * 1j, [[0, 1, 2]], "vertices must be real numbers, got dtype complex128"),
        (np.eye(3)[:, :2], [[0, 1, 2]], "vertices must have three columns, got shape (3, 2)"),
        (np.eye(3), [0, 1, 2], "faces must have three columns, got shape (3,)"),
        (np.full((3, 3), np.inf), [[0, 1, 2]], "vertex 0 of triangle 0 must be finite float32 numbers"),
    ],
)
def test_npz_arrays_that_are_no_mesh_are_refused(vertices, faces, expected):
    file = io.BytesIO()
    np.savez(file, vertices=vertices, faces=faces)
    with pytest.raises(ValueError) as error:
        wive.load_mesh(file.getvalue(), file_type="npz")
    assert str(error.value).startswith(f"mesh (bytes): {expected}")
