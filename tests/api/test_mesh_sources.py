"""Mesh files as paths, bytes and file objects, and how their format is told."""

import bz2
import gzip
import io
import lzma
import pathlib
import tempfile
import zipfile

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


@pytest.mark.parametrize(("kind", "module"), {"gz": gzip, "bz2": bz2, "xz": lzma}.items())
def test_streams_that_unpack_need_no_file_type_and_packed_content_is_refused(kind, module, tmp_path):
    path = tmp_path / f"mesh.obj.{kind}"
    path.write_bytes(module.compress(OBJ))
    with module.open(path) as file:
        assert len(wive.load_mesh(file)[1]) == 6
    for source in (path, path.read_bytes()):
        for file_type in (None, "obj", "stl", "npz"):
            with pytest.raises(ValueError, match="is compressed: unpack it, or pass a file object that does"):
                wive.load_mesh(source, file_type=file_type)


def streams_that_fail(folder) -> dict[str, io.IOBase]:
    packed = gzip.compress(OBJ)
    (folder / "cut.gz").write_bytes(packed[:-9])
    (folder / "damaged.gz").write_bytes(packed[:15] + b"\xff\xff" + packed[17:])
    (folder / "other.gz").write_bytes(b"hello")
    (folder / "other.xz").write_bytes(b"hello" * 9)
    (folder / "binary.stl").write_bytes(b"\xff" * 84)
    with open(folder / "binary.stl", "rb") as closed:
        pass
    return {
        "cut.gz": gzip.open(folder / "cut.gz"),
        "damaged.gz": gzip.open(folder / "damaged.gz"),
        "other.gz": gzip.open(folder / "other.gz"),
        "other.xz": lzma.open(folder / "other.xz"),
        "binary.stl": open(folder / "binary.stl", encoding="utf-8"),
        "written": open(folder / "written", "wb"),
        "closed": closed,
        "broken": Broken(RuntimeError("a\nb")),
        "failing disk": Broken(OSError(5, "Input/output error")),
    }


class Broken(io.BytesIO):
    def __init__(self, error: Exception) -> None:
        super().__init__()
        self.error = error

    def read(self, *_):
        raise self.error


def test_streams_that_fail_are_refused_in_one_line(tmp_path):
    for name, stream in streams_that_fail(tmp_path).items():
        named = getattr(stream, "name", None)  # Python 3.13 tells none of closed streams that unpack
        with pytest.raises((ValueError, OSError)) as error:
            wive.load_mesh(stream, file_type="obj")
        stream.close()
        assert str(error.value).isprintable(), name
        assert (named if isinstance(named, str) else "mesh (file object)") in str(error.value), name


def test_text_streams_give_the_bytes_that_they_were_read_from(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_bytes(b"# st\xfchle\n" + OBJ)
    for options in ({"encoding": "latin-1"}, {"encoding": "utf-8", "errors": "surrogateescape"}):
        with open(path, **options) as file:
            assert len(wive.load_mesh(file)[1]) == 6


def test_names_with_line_breaks_stay_on_one_line(tmp_path):
    path = tmp_path / "two\nlines.obj"
    path.write_bytes(b"bad")
    with pytest.raises(ValueError, match=r"two\\nlines.obj: line 1: expected a statement of OBJ") as error:
        wive.load_mesh(path)
    assert str(error.value).isprintable()
    with open(path, "rb") as file, pytest.raises(ValueError, match=r"two\\nlines.obj: line 1"):
        wive.load_mesh(file)


def test_archives_of_other_files_are_called_so():
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("mesh.obj", OBJ)
    with pytest.raises(ValueError, match="is an archive: unpack it"):
        wive.load_mesh(file.getvalue())


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
        (np.empty((3, 0)), [[0, 1, 2]], "vertices must have three columns, got shape (3, 0)"),
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
