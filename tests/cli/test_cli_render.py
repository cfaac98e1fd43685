"""`wive render`: shadings, light, colours and formats."""

import numpy as np
import pytest
from support.meshes import sphere
from support.rooms import room

import wive
from wive.cli import main

SMALL = ("--width", "32", "--height", "20", "--spp", "4")


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


@pytest.fixture
def files(tmp_path):
    for name, (vertices, faces) in (("ball", sphere(2)), ("room", room())):
        np.savez(tmp_path / f"{name}.npz", vertices=vertices, faces=faces)
    return tmp_path


@pytest.mark.parametrize("shading", ["path", "ao", "headlight", "normals", "depth"])
def test_pictures_are_those_of_the_library(files, capsys, shading):
    options = ("--shading", shading, "--seed", 7, "--exposure", 0.5, "--reach", 2)
    assert run("render", files / "room.npz", "-o", files / "a.npy", *SMALL, *options) == 0
    assert f"a.npy: {shading}, " in capsys.readouterr().out
    expected = wive.render(
        wive.Scene(*room()), shading=shading, width=32, height=20, spp=4, seed=7, exposure=0.5, reach=2
    )
    np.testing.assert_array_equal(np.load(files / "a.npy"), expected)


def test_the_default_is_path_outside_and_ao_inside(files, capsys):
    for name, shading in (("ball", "path"), ("room", "ao")):
        assert run("render", files / f"{name}.npz", "-o", files / "a.npy", *SMALL) == 0
        assert f": {shading}, " in capsys.readouterr().out
        assert np.load(files / "a.npy").mean() > 0.25


def test_a_picture_that_no_light_reaches_says_what_would_show_the_room(files, capsys):
    for name, options, is_dark in (
        ("room", ("--shading", "path"), True),
        ("room", ("--shading", "path", "--sky", "black"), False),  # as asked
        ("room", ("--shading", "ao"), False),
        ("ball", ("--shading", "path"), False),
    ):
        assert run("render", files / f"{name}.npz", "-o", files / "a.npy", *SMALL, *options) == 0
        assert ("--shading ao shows rooms" in capsys.readouterr().err) == is_dark


def test_light_is_that_of_the_options(files):
    pictures = []
    for options in ((), ("--sky", "white"), ("--sky", "black", "--sun", 0, 1, 0), ("--exposure", "auto")):
        assert run("render", files / "ball.npz", "-o", files / "a.npy", *SMALL, *options) == 0
        pictures.append(np.load(files / "a.npy"))
    assert len({picture.tobytes() for picture in pictures}) == 4
    assert (pictures[1] <= 1).all() and (pictures[2][0, 0] == 0).all()


def test_colours_of_the_file_are_shown_unless_others_are_asked_for(tmp_path):
    mesh = tmp_path / "a.obj"
    mesh.write_text("v 0 0 0 1 0 0\nv 4 0 0 1 0 0\nv 4 4 0 1 0 0\nf 1 2 3\n")
    found = {}
    for albedo in (None, "file", "gray", "normals"):
        options = () if albedo is None else ("--albedo", albedo)
        view = ("--eye", 3, 2, 5, "--target", 3, 1, 0, "--fov", 5, "--shading", "headlight")
        assert run("render", mesh, "-o", tmp_path / "a.npy", *SMALL, *view, *options) == 0
        found[albedo] = np.load(tmp_path / "a.npy")
    np.testing.assert_array_equal(found[None], found["file"])
    assert (found["file"][..., 0] > 0.7).all() and (found["file"][..., 1] == 0).all()
    assert np.ptp(found["gray"], axis=2).max() == 0 and found["gray"].max() <= 0.6
    assert np.ptp(found["normals"], axis=2).max() > 0.1


def test_printers_files_have_z_up_and_gltf_has_y_up(tmp_path):
    """A tall post: upright in the picture, higher than wide, or lying and wider than high."""
    trimesh = pytest.importorskip("trimesh")
    for name, axis in (("a.stl", 2), ("a.3mf", 2), ("a.glb", 1), ("a.obj", 1)):
        extents = np.ones(3)
        extents[axis] = 6
        if name == "a.3mf":
            pytest.importorskip("networkx") and pytest.importorskip("lxml")
        trimesh.creation.box(extents).export(tmp_path / name)
        size = ("--width", 40, "--height", 40, "--spp", 1, "--shading", "depth")
        assert run("render", tmp_path / name, "-o", tmp_path / "a.npy", *size) == 0
        rows, columns = np.nonzero(np.isfinite(np.load(tmp_path / "a.npy")))
        assert np.ptp(rows) > 2 * np.ptp(columns), name


def test_png_of_normals_holds_their_values(files):
    pillow = pytest.importorskip("PIL.Image")
    for name in ("a.png", "a.npy"):
        assert run("render", files / "ball.npz", "-o", files / name, *SMALL, "--shading", "normals") == 0
    with pillow.open(files / "a.png") as image:
        np.testing.assert_allclose(np.asarray(image) / 255, np.load(files / "a.npy"), atol=0.5 / 255 + 1e-6)


def test_the_terrain_has_the_colours_of_land(tmp_path, monkeypatch):
    """Green low, brown high, and sky above it: it reads as terrain."""
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    assert run("render", "-o", "a.npy", "--width", 96, "--height", 54, "--spp", 2) == 0
    red, green, blue = np.moveaxis(np.load("a.npy"), -1, 0)
    is_sky = blue > 1.05 * green
    assert is_sky[:2].mean() > 0.7 and is_sky[-20:].mean() < 0.05
    land = ~is_sky
    assert (green > 1.2 * red)[land].mean() > 0.3, "meadows and forests"
    assert (red > green)[land].mean() > 0.1, "heights"


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--shading", "fast"), "argument --shading: invalid choice: 'fast'"),
        (("--sky", "blue"), "argument --sky: invalid choice: 'blue'"),
        (("--sun", "0", "0"), "argument --sun: expected 3 arguments"),
    ],
)
def test_bad_choices_are_one_line(files, capsys, options, expected):
    with pytest.raises(SystemExit) as leaving:
        run("render", files / "ball.npz", *options)
    assert leaving.value.code == 2
    error = capsys.readouterr().err
    assert expected in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--exposure", "bright"), "exposure must be a number of stops or 'auto', got 'bright'"),
        (("--exposure", "nan"), "exposure must be finite, got nan"),
        (("--exposure", "99"), "exposure must be from -60 to 60 stops, got 99"),
        (("--reach", "0"), "reach must be above 0, got 0"),
        (("--reach", "nan"), "reach must be finite, got nan"),
        (("--sun", "0", "0", "0"), "sun must be a direction towards the sun, got the zero vector"),
        (("--sun", "nan", "0", "0"), "sun must be finite, got [nan, 0.0, 0.0]"),
        (
            ("-o", "a.hdr", "--shading", "depth"),
            "a.hdr: HDR files hold no depth: write it to .exr, .tiff, .npy or .png",
        ),
    ],
)
def test_bad_values_are_one_line_and_leave_no_file(files, monkeypatch, capsys, options, expected):
    monkeypatch.chdir(files)
    before = sorted(files.iterdir())
    assert run("render", files / "ball.npz", *SMALL, *options) == 2
    assert capsys.readouterr().err == f"wive: error: {expected}\n"
    assert sorted(files.iterdir()) == before


@pytest.mark.parametrize("name", ["a.exr", "a.hdr", "a.tif", "a.npy"])
def test_no_format_replaces_a_file_that_is_read(files, capsys, name):
    pytest.importorskip({"a.exr": "OpenEXR", "a.tif": "tifffile"}.get(name, "numpy"))
    mesh = files / "ball.npz"
    (files / name).symlink_to(mesh)
    content = mesh.read_bytes()
    assert run("render", mesh, "-o", files / name, *SMALL) == 2
    assert "is the input file" in capsys.readouterr().err
    assert mesh.read_bytes() == content
