"""Cameras and pictures."""

import numpy as np
import pytest
from support.meshes import sphere

import wive
from wive.rendering import write_png

# Paths under a sky of radiance 1, without a sun.
WHITE = {"shading": "path", "sky": "white"}

FLOOR = (
    np.array([[-1000, 0, -1000], [1000, 0, -1000], [1000, 0, 1000], [-1000, 0, 1000]], np.float32),
    np.array([[0, 2, 1], [0, 3, 2]], np.int32),
)
SMALL = {"width": 48, "height": 32, "spp": 4}


def projected(camera: wive.Camera, points: np.ndarray, width: int, height: int) -> np.ndarray:
    """Picture coordinates, -1 to 1 from left to right and from bottom to top."""
    eye, forward, right, top = camera.frame(width, height).astype(np.float64)
    relative = points - eye
    depth = relative @ forward
    assert (depth > 0).all()
    return (
        np.stack([relative @ right / (right @ right), relative @ top / (top @ top)], axis=1) / depth[:, None]
    )


@pytest.mark.parametrize("aspect", [0.5, 1, 16 / 9])
@pytest.mark.parametrize("extent", [(1, 1, 1), (10, 1, 3), (1, 10, 1), (30, 20, 1), (1, 20, 20), (5, 0, 5)])
@pytest.mark.parametrize("up", [None, (0, 1, 0), (1, 0, 0), (0, -1, 1)])
def test_a_framed_box_just_fits_the_picture(extent, aspect, up):
    low = np.array([100, -50, 7])
    bounds = np.stack([low, low + extent])
    camera = wive.Camera.framing(bounds, up, aspect=aspect)
    corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)
    places = projected(camera, corners, round(1000 * aspect), 1000)
    tightest = np.argmax(np.ptp(places, axis=0))
    assert 0.9 < abs(places).max() < 1
    assert places[:, tightest].min() == pytest.approx(-places[:, tightest].max(), abs=0.01)


def test_framing_takes_a_flat_axis_as_up_else_y():
    assert np.asarray(wive.Camera.framing([[0, 0, 0], [30, 20, 2]]).up).tolist() == [0, 0, 1]
    assert np.asarray(wive.Camera.framing([[0, 0, 0], [2, 20, 20]]).up).tolist() == [1, 0, 0]
    assert np.asarray(wive.Camera.framing([[0, 0, 0], [3, 2, 4]]).up).tolist() == [0, 1, 0]


def test_fov_is_the_vertical_angle_and_right_is_right():
    camera = wive.Camera(eye=(0, 0, 5), target=(0, 0, 0), up=(0, 1, 0), fov=90)
    np.testing.assert_allclose(
        camera.frame(200, 100), [[0, 0, 5], [0, 0, -1], [2, 0, 0], [0, 1, 0]], atol=1e-6
    )


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"eye": (0, 0, 0)}, r"eye and target must differ, got \(0, 0, 0\) for both"),
        ({"up": (0, 0, 2)}, r"up must not be zero or along the view, got \(0, 0, 2\)"),
        ({"up": (0, 0, 0)}, r"up must not be zero or along the view, got \(0, 0, 0\)"),
        ({"fov": 180}, "fov must be between 0 and 180 degrees, got 180"),
        ({"fov": float("nan")}, "fov must be finite, got nan"),
        ({"eye": (1, 2)}, r"eye must be three real numbers, got an array of shape \(2,\)"),
        ({"eye": (1, 2, np.inf)}, r"eye must be finite, got \[1.0, 2.0, inf\]"),
    ],
)
def test_a_camera_without_a_picture_is_refused(changes, expected):
    with pytest.raises(ValueError, match=f"^{expected}$"):
        wive.Camera(**{"eye": (0, 0, 5), "target": (0, 0, 0), **changes})


def test_nothing_can_be_framed_in_an_empty_scene():
    with pytest.raises(ValueError, match="bounds must be finite to be framed"):
        wive.render(wive.Scene([], []))


@pytest.mark.parametrize(
    ("options", "kind", "expected"),
    [
        ({"width": 0}, ValueError, "width must be from 1 to 65536, got 0"),
        ({"height": 2.5}, TypeError, "height must be an integer, got float 2.5"),
        ({"spp": 0}, ValueError, "spp must be from 1 to 2147483647, got 0"),
        ({"bounces": -1}, ValueError, "bounces must be from 0 to 2147483647, got -1"),
        ({"seed": -1}, ValueError, "seed must be from 0 to 2147483647, got -1"),
        ({"threads": 0}, ValueError, "threads must be from 1 to 2147483647, got 0"),
        (
            {"albedo": "red"},
            ValueError,
            "albedo must be one of gray, normals in this version of wive, got 'red'",
        ),
    ],
)
def test_bad_settings_are_named(options, kind, expected):
    with pytest.raises(kind) as error:
        wive.render(wive.Scene(*sphere(0)), **options)
    assert str(error.value) == expected


def test_an_argument_that_there_is_none_of_is_named():
    with pytest.raises(TypeError, match=r"^render\(\) got an unexpected keyword argument 'shade'$"):
        wive.render(wive.Scene(*sphere(0)), shade="ao")


@pytest.mark.parametrize("albedo", ["gray", "normals"])
def test_a_picture_is_the_same_on_any_backend_and_thread_count(usable_backends, monkeypatch, albedo):
    mesh = sphere(3)
    first = wive.render(wive.Scene(*mesh, backend=usable_backends[0]), albedo=albedo, threads=1, **SMALL)
    assert first.shape == (32, 48, 3)
    assert first.dtype == np.float32
    for name in usable_backends:
        options = {} if name == "warp" else {"threads": 5}
        picture = wive.render(wive.Scene(*mesh, backend=name), albedo=albedo, **options, **SMALL)
        np.testing.assert_array_equal(picture, first)
    monkeypatch.setattr(wive.rendering, "BAND_PATHS", 1)
    np.testing.assert_array_equal(wive.render(wive.Scene(*mesh), albedo=albedo, **SMALL), first)


def test_a_picture_checks_the_mesh_once(monkeypatch):
    scene = wive.Scene(*sphere(2))
    bvh, checks = scene._tracer.bvh, []

    class Watched:
        def __getattr__(self, name):
            return getattr(bvh, name)

        def render_rows(self, *arguments, check, **keywords):
            checks.append(check)
            return bvh.render_rows(*arguments, check=check, **keywords)

    monkeypatch.setattr(scene._tracer, "bvh", Watched())
    monkeypatch.setattr(wive.rendering, "BAND_PATHS", 1)
    for _ in range(2):
        checks.clear()
        wive.render(scene, **SMALL)
        assert checks == [True] + [False] * (len(checks) - 1)
        assert len(checks) == SMALL["height"]


def test_a_picture_of_a_mesh_that_was_changed_after_the_build_is_refused():
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces)
    camera = wive.Camera.framing(scene.bounds)
    faces[7, 1] = len(vertices)
    with pytest.raises(ValueError, match=r"^faces must index the .* in face 7$"):
        wive.render(scene, camera, shading="path", **SMALL)


def test_another_seed_is_another_picture_of_the_same_scene(backend):
    scene = wive.Scene(*sphere(3), backend=backend)
    one, other = (wive.render(scene, seed=seed, width=64, height=64, spp=16) for seed in (0, 1))
    assert (one != other).any()
    assert one.mean() == pytest.approx(other.mean(), rel=0.01)


def test_the_sky_is_white(backend):
    camera = wive.Camera(eye=(0, 0, 10), target=(0, 0, 20))
    assert (wive.render(wive.Scene(*sphere(1), backend=backend), camera, **WHITE, **SMALL) == 1).all()


def test_no_light_gets_into_a_closed_surface(backend):
    camera = wive.Camera(eye=(0, 0, 0), target=(0.3, 0.2, 1), fov=100)
    picture = wive.render(wive.Scene(*sphere(4), backend=backend), camera, bounces=3, **WHITE, **SMALL)
    assert (picture == 0).all()


def test_an_open_floor_reflects_its_albedo(backend):
    camera = wive.Camera(eye=(0, 10, 0), target=(0, 0, 0), up=(0, 0, -1))
    picture = wive.render(wive.Scene(*FLOOR, backend=backend), camera, **WHITE, **SMALL)
    assert 0 < picture[0, 0, 0] < 1
    np.testing.assert_allclose(picture, picture[0, 0, 0], rtol=1e-5)


def test_normal_colours_depend_on_the_normal(backend):
    scene = wive.Scene(*sphere(4), backend=backend)
    gray, normals = (wive.render(scene, albedo=albedo, **WHITE, **SMALL) for albedo in ("gray", "normals"))
    assert np.ptp(gray, axis=2).max() == 0
    assert np.ptp(normals, axis=2).max() > 0.2


def test_right_is_right_and_top_is_the_first_row(backend):
    vertices, faces = sphere(3)
    scene = wive.Scene(vertices + np.float32([2, 1, 0]), faces, backend=backend)
    camera = wive.Camera(eye=(0, 0, 10), target=(0, 0, 0), fov=40)
    dark = wive.render(scene, camera, **WHITE, **SMALL).mean(axis=2) < 1
    rows, columns = np.nonzero(dark)
    assert rows.mean() < 13
    assert columns.mean() > 26


def test_a_framed_mesh_fills_the_picture_but_not_the_corners(backend):
    scene = wive.Scene(*sphere(3), backend=backend)
    dark = wive.render(scene, **WHITE, width=64, height=64, spp=1).mean(axis=2) < 1
    assert 0.15 < dark.mean() < 0.8
    assert not dark[[0, 0, -1, -1], [0, -1, 0, -1]].any()


def test_png_files_are_srgb(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    linear = np.float32([0, 0.001, 0.5, 1, 7])
    write_png(tmp_path / "picture.png", np.repeat(linear[None, :, None], 3, axis=2))
    with pillow.open(tmp_path / "picture.png") as picture:
        assert picture.size == (5, 1)
        assert [picture.getpixel((x, 0)) for x in range(5)] == [(v, v, v) for v in (0, 3, 188, 255, 255)]
