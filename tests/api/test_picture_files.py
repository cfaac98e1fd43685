"""Picture files: what is written is what is read, in every format."""

import builtins
import importlib
import sys

import numpy as np
import pytest

import wive
from wive._internal.pictures.image_files import check_picture_output

PICTURE = np.random.default_rng(5).random((7, 11, 3)).astype(np.float32) ** 3 * 40
DEPTH = np.where(np.arange(12).reshape(3, 4) % 5 == 0, np.inf, np.arange(12).reshape(3, 4) + 2).astype(
    np.float32
)


def read_exr(path, channel: str) -> np.ndarray:
    openexr = pytest.importorskip("OpenEXR")
    with openexr.File(str(path)) as file:
        return np.array(file.channels()[channel].pixels)


def read_hdr(path) -> np.ndarray:
    """Radiance RGBE without run lengths, Ward 1991."""
    header, _, pixels = path.read_bytes().partition(b"\n\n")
    assert header == b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe"
    size, _, pixels = pixels.partition(b"\n")
    _, height, _, width = size.split()
    assert size.startswith(b"-Y ") and b" +X " in size
    rgbe = np.frombuffer(pixels, np.uint8).reshape(int(height), int(width), 4)
    return np.ldexp(rgbe[..., :3] + 0.5, rgbe[..., 3:].astype(int) - 136) * (rgbe[..., 3:] > 0)


def test_npy_holds_the_numbers(tmp_path):
    for name, image in (("a.npy", PICTURE), ("B.NPY", DEPTH)):
        wive.write_picture(tmp_path / name, image)
        np.testing.assert_array_equal(np.load(tmp_path / name), image)


@pytest.mark.parametrize("name", ["a.npy", "a.hdr", "a.png"])
def test_numbers_beyond_float32_are_infinite_without_a_warning(tmp_path, name):
    wive.write_picture(tmp_path / name, PICTURE.astype(np.float64) + 1e300)
    wive.write_picture(tmp_path / "b.npy", PICTURE + np.float32(np.inf))
    if name == "a.npy":
        assert (tmp_path / name).read_bytes() == (tmp_path / "b.npy").read_bytes()


def test_exr_holds_the_numbers(tmp_path):
    for channel, image in (("RGB", PICTURE), ("Z", DEPTH)):
        pytest.importorskip("OpenEXR")
        wive.write_picture(tmp_path / "a.exr", image)
        np.testing.assert_array_equal(read_exr(tmp_path / "a.exr", channel), image)


@pytest.mark.parametrize("name", ["a.tif", "a.tiff"])
def test_tiff_holds_the_numbers(tmp_path, name):
    tifffile = pytest.importorskip("tifffile")
    for image in (PICTURE, DEPTH):
        wive.write_picture(tmp_path / name, image)
        found = tifffile.imread(tmp_path / name)
        assert found.dtype == np.float32
        np.testing.assert_array_equal(found, image)


def test_hdr_holds_the_numbers_to_a_percent(tmp_path):
    image = PICTURE.copy()
    image[0, :4] = [[0, 0, 0], [1e-30, 2e-30, 3e-30], [1e30, 1, 0], [-1, np.nan, 2]]
    wive.write_picture(tmp_path / "a.hdr", image)
    expected = np.nan_to_num(np.maximum(image, 0))
    found = read_hdr(tmp_path / "a.hdr")
    largest = expected.max(axis=2, keepdims=True)
    np.testing.assert_allclose(
        found / np.maximum(largest, 1e-37), expected / np.maximum(largest, 1e-37), atol=0.005
    )
    assert (found[0, 0] == 0).all()


def test_a_png_of_normals_holds_their_values_and_one_of_radiance_is_srgb(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    image = np.full((2, 2, 3), 0.5, np.float32)
    for srgb, level in ((True, 188), (False, 128)):
        wive.write_picture(tmp_path / "a.png", image, srgb=srgb)
        with pillow.open(tmp_path / "a.png") as found:
            assert np.unique(np.asarray(found)).tolist() == [level]


def test_a_png_of_depth_is_white_near_dark_far_and_black_where_nothing_is(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    wive.write_picture(tmp_path / "a.png", DEPTH)
    with pillow.open(tmp_path / "a.png") as found:
        levels = np.asarray(found)
    assert (levels[np.isinf(DEPTH)] == 0).all()
    there = np.sort(levels[np.isfinite(DEPTH)])[::-1]
    assert there[0] == 255 and there[-1] == 26 and (np.diff(there.astype(int)) < 0).all()
    for nothing in (np.full((2, 3), np.inf), np.full((2, 3), 7.0)):
        wive.write_picture(tmp_path / "a.png", nothing)
        with pillow.open(tmp_path / "a.png") as found:
            assert np.unique(np.asarray(found)).tolist() == [255 if np.isfinite(nothing).all() else 0]


@pytest.mark.parametrize(
    ("name", "image", "kind", "expected"),
    [
        ("a.jpg", PICTURE, ValueError, "output file must end in .png, .exr, .hdr, .npy, .tif or .tiff, got "),
        ("a", PICTURE, ValueError, "output file must end in "),
        ("a.hdr", DEPTH, ValueError, "HDR files hold no depth: write it to .exr, .tiff, .npy or .png"),
        ("a.npy", PICTURE[..., :2], ValueError, "image must have shape (h, w, 3) or (h, w), got (7, 11, 2)"),
        ("a.npy", np.zeros((0, 3)), ValueError, "image must have shape (h, w, 3) or (h, w), got (0, 3)"),
        ("a.npy", np.zeros((2, 2, 3), np.uint8), TypeError, "image must be floats, got dtype uint8: divide"),
        ("a.npy", "picture", TypeError, "image must be an array of real numbers"),
        ("no/a.npy", PICTURE, FileNotFoundError, "does not exist: create it first"),
    ],
)
def test_what_can_not_be_written_is_one_line_and_leaves_no_file(tmp_path, name, image, kind, expected):
    with pytest.raises(kind) as error:
        wive.write_picture(tmp_path / name, image)
    assert expected in str(error.value) and "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [("a.png", "PIL", "render"), ("a.exr", "OpenEXR", "images"), ("a.tif", "tifffile", "images")],
)
def test_a_missing_package_is_named_with_the_command_before_anything_is_rendered(
    tmp_path, monkeypatch, name, module, extra
):
    for loaded in [module, *(each for each in sys.modules if each.startswith(f"{module}."))]:
        monkeypatch.setitem(sys.modules, loaded, None)
    for call in (check_picture_output, lambda path: wive.write_picture(path, PICTURE)):
        with pytest.raises(ImportError, match=f'pip install "wive\\[{extra}\\]"'):
            call(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_that_a_library_fails_to_write_leaves_the_old_one(tmp_path, monkeypatch):
    openexr = pytest.importorskip("OpenEXR")

    class Failing:
        def __init__(self, *arguments):
            pass

        def write(self, name):
            raise RuntimeError("disk\nfull")

    (tmp_path / "a.exr").write_bytes(b"old")
    monkeypatch.setattr(openexr, "File", Failing)
    with pytest.raises(OSError, match=r"a\.exr: disk full$"):
        wive.write_picture(tmp_path / "a.exr", PICTURE)
    assert (tmp_path / "a.exr").read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


def test_picture_libraries_are_imported_when_needed_alone(monkeypatch):
    imported = []
    real = builtins.__import__

    def watched(name, *arguments):
        imported.append(name)
        return real(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", watched)
    importlib.reload(importlib.import_module("wive._internal.pictures.image_files"))
    assert not {"PIL", "PIL.Image", "OpenEXR", "tifffile"} & set(imported)
