"""Pictures from a Warp device are those of the CPU core, bit for bit."""

import numpy as np
import pytest
from support.meshes import soup, sphere

import wive
from wive.cli import main


@pytest.fixture(scope="module")
def both(device):
    """A scene with shade, twice: on the CPU core and on the device."""
    ball, shards = sphere(3), soup(150, seed=5)
    vertices = np.concatenate([ball[0], shards[0] * 3 - 1.5])
    faces = np.concatenate([ball[1], shards[1] + len(ball[0])])
    return wive.Scene(vertices, faces), wive.Scene(vertices, faces, device=device)


@pytest.mark.parametrize("albedo", ["gray", "normals"])
@pytest.mark.parametrize(
    ("width", "height", "spp"),
    [
        (48, 32, 4),
        (33, 9, 7),  # a tile of 32 columns and one of one
        (5, 3, 1000),  # more samples than one wave of five pixels holds
        (40, 2, 300),  # as many for tiles of 32 and of 8
        (1, 1, 1),
    ],
)
def test_a_picture_is_that_of_the_cpu_to_the_bit(both, albedo, width, height, spp):
    expected, found = (
        wive.render(scene, shading="path", width=width, height=height, spp=spp, albedo=albedo)
        for scene in both
    )
    np.testing.assert_array_equal(found, expected)
    if width * height > 1:
        assert (expected < 1).any()


@pytest.mark.parametrize("bounces", [0, 1, 30])
def test_bounces_and_seed_are_those_of_the_cpu(both, bounces):
    settings = {"shading": "path", "width": 40, "height": 20, "spp": 3, "bounces": bounces, "seed": 77}
    expected, found = (wive.render(scene, **settings) for scene in both)
    np.testing.assert_array_equal(found, expected)


def test_bands_and_passes_change_no_bit(both, monkeypatch):
    from wive.warp_kernels.scene import render as warp_render

    settings = {"shading": "path", "width": 100, "height": 12, "spp": 200}
    expected = wive.render(both[1], **settings)
    monkeypatch.setattr(warp_render, "MOST_PATHS", warp_render.WAVE_SIZE)
    monkeypatch.setattr(wive.rendering, "BAND_PATHS", 5 * 100 * 200)
    monkeypatch.setattr(wive.rendering, "CUDA_BAND_PATHS", 5 * 100 * 200)
    np.testing.assert_array_equal(wive.render(both[1], **settings), expected)


def test_as_many_rays_are_traced_as_on_the_cpu(both):
    from wive._internal.picture import Settings
    from wive.rendering import render_counted

    settings = Settings(shading="path", width=50, height=30, spp=3)
    rays = [render_counted(scene, None, settings, progress=False).rays for scene in both]
    assert rays[0] == rays[1] > 50 * 30 * 3


@pytest.mark.parametrize("sky", ["day", "cloudy", "black"])
@pytest.mark.parametrize("rows", ["vertices", "faces"])
def test_light_and_colours_are_those_of_the_cpu(both, sky, rows):
    random = np.random.default_rng(3)
    albedo = random.random((len(getattr(both[0], rows)), 3))
    what = {"shading": "path", "width": 40, "height": 30, "spp": 5, "sky": sky, "sun": (0.3, 1, 0.4)}
    expected, found = (wive.render(scene, albedo=albedo, **what) for scene in both)
    np.testing.assert_array_equal(found, expected)
    assert np.ptp(expected, axis=2).max() > 0.05


@pytest.mark.parametrize("shading", ["ao", "headlight", "normals", "depth"])
def test_other_shadings_are_those_of_the_cpu(both, shading):
    what = {"shading": shading, "width": 40, "height": 30, "spp": 5, "reach": 2.5}
    expected, found = (wive.render(scene, **what) for scene in both)
    np.testing.assert_array_equal(found, expected)
    assert np.unique(expected).size > 50


def test_the_command_line_renders_on_a_device(both, tmp_path, capsys, device):
    image = pytest.importorskip("PIL.Image")
    np.savez(tmp_path / "mesh.npz", vertices=both[0].vertices, faces=both[0].faces)
    pixels = []
    for name, options in (("cpu.png", []), ("device.png", ["--device", device])):
        size = ["--width", "32", "--height", "32", "--spp", "4"]
        assert main(["render", str(tmp_path / "mesh.npz"), "-o", str(tmp_path / name), *size, *options]) == 0
        with image.open(tmp_path / name) as picture:
            pixels.append(np.asarray(picture))
    np.testing.assert_array_equal(*pixels)
    assert f"warp on {device}" in capsys.readouterr().out
