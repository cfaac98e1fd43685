"""The light of path-traced pictures: sky, sun, colours of surfaces, exposure."""

import numpy as np
import pytest
from support.meshes import sphere
from support.rooms import box, joined

import wive
from wive._internal.pictures.daylight import RADIANCES, SUN, light_of

FLOOR = (
    np.array([[-1000, 0, -1000], [1000, 0, -1000], [1000, 0, 1000], [-1000, 0, 1000]], np.float32),
    np.array([[0, 2, 1], [0, 3, 2]], np.int32),
)
DOWN = wive.Camera(eye=(0, 10, 0), target=(0, 0, 0), up=(0, 0, -1))
SMALL = {"shading": "path", "width": 32, "height": 20, "spp": 16}


def test_the_sky_is_brightest_where_it_should_be(backend):
    """Straight up it has the zenith's colour, at and below the horizon the horizon's."""
    scene = wive.Scene(*sphere(1), backend=backend)
    for sky, radiances in RADIANCES.items():
        for toward, expected in (
            ((1, 1e4, 0), radiances.zenith),
            ((1, -1e-3, 0), radiances.horizon),
            ((1, -1e4, 0), radiances.horizon),
        ):
            camera = wive.Camera((0, 5, 0), np.add((0, 5, 0), toward), fov=0.001)
            low = wive.Camera((0, -5, 0), np.add((0, -5, 0), toward), fov=0.001)
            picture = wive.render(scene, low if toward[1] < 0 else camera, sky=sky, **SMALL)
            np.testing.assert_allclose(picture[10, 16], expected, atol=1e-3)


def test_up_of_a_calibrated_camera_is_the_axis_nearest_to_its_pictures_top():
    pose = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])  # looks along y, z is up
    camera = wive.PinholeCamera((10, 10, 15.5, 9.5), pose)
    scene = wive.Scene(np.float32([[0, 0, -9], [1, 0, -9], [0, 1, -9]]), [[0, 1, 2]])
    picture = wive.render(scene, camera, sky="day", **SMALL)
    assert picture[0, 16, 0] < picture[9, 16, 0] and picture[0, 16, 0] < picture[19, 16, 0]


def test_a_floor_in_the_sun_alone_has_the_suns_light_times_the_cosine(backend):
    scene = wive.Scene(*FLOOR, backend=backend)
    for height in (90, 50, 20):
        sun = (0, np.sin(np.radians(height)), np.cos(np.radians(height)))
        picture = wive.render(scene, DOWN, sky="black", sun=sun, albedo=(0.2, 0.5, 1.0), **SMALL)
        expected = np.array([0.2, 0.5, 1.0]) * SUN * np.sin(np.radians(height))
        np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), rtol=1e-4)


def test_the_sun_casts_a_shadow_to_the_side_away_from_it(backend):
    mesh = joined(FLOOR, box((-1, 0, -1), (1, 2, 1)))
    scene = wive.Scene(*mesh, backend=backend)
    camera = wive.Camera(eye=(0, 30, 0), target=(0, 0, 0), up=(0, 0, -1), fov=20)
    picture = wive.render(scene, camera, sky="black", sun=(1, 1, 0), bounces=1, **SMALL)
    middle = picture[10, :, 1]
    assert (middle[11:13] < 1e-3).all(), "2 units of shadow to the left"
    assert (middle[20:] > 0.3).all(), "and light to the right"


def test_a_sun_below_the_horizon_lights_no_ground():
    picture = wive.render(wive.Scene(*FLOOR), DOWN, sky="black", sun=(0, -1, 1), **SMALL)
    assert (picture == 0).all()


def test_the_default_sun_is_above_on_the_left_of_the_camera():
    for up in ((0, 0, 1), (0, 1, 0), (0.2, 0.4, 1)):
        camera = wive.Camera(eye=(3, -5, 2), target=(0, 0, 0), up=up)
        unit = np.array(up) / np.linalg.norm(up)
        frame = camera._frame(16, 9)
        to_sun = light_of("day", None, frame, unit)[3]
        assert to_sun @ frame[2] < -0.3 and to_sun @ unit > 0.4
        assert np.linalg.norm(to_sun) == pytest.approx(1, abs=1e-6)


def test_colours_of_triangles_and_vertices_are_those_of_the_picture(backend):
    scene = wive.Scene(*FLOOR, backend=backend)
    white = {"sky": "white", "bounces": 1, **SMALL}
    for shading, light in (("path", 1), ("headlight", None), ("ao", 1)):
        what = {**white, "shading": shading}
        half = [[1, 0, 0], [0, 0, 1]]
        picture = wive.render(scene, DOWN, albedo=np.array(half, float), **what)
        assert set(map(tuple, np.sign(picture).reshape(-1, 3))) >= {(1, 0, 0), (0, 0, 1)}
        by_corner = np.array(
            [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], float
        )  # red at z -1000, green at 1000
        picture = wive.render(scene, DOWN, albedo=by_corner, **what)
        if light:
            np.testing.assert_allclose(picture[..., :2], 0.5, atol=0.01)
        assert (picture[..., 2] == 0).all()


def test_eight_bit_colours_are_srgb_and_their_alpha_does_not_count():
    scene, what = wive.Scene(*FLOOR), {"sky": "white", "bounces": 1, **SMALL}
    for columns in ([188, 0, 255], [188, 0, 255, 7]):
        colours = np.tile(np.array(columns, np.uint8), (2, 1))
        picture = wive.render(scene, DOWN, albedo=colours, **what)
        np.testing.assert_allclose(picture[0, 0], [0.5028865, 0, 1], rtol=1e-5)


def test_as_many_vertices_as_triangles_have_the_colours_of_vertices_unless_shaped_as_triangles():
    vertices = np.float32([[-5, 0, -5], [5, 0, -5], [5, 0, 5], [-5, 0, 5]])
    faces = [[0, 2, 1], [0, 3, 2], [0, 2, 1], [0, 3, 2]]
    colours = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0]], float)
    camera = wive.Camera(eye=(0, 5, 0), target=(0, 0, 0), up=(0, 0, -1))
    pictures = [
        wive.render(wive.Scene(vertices, faces), camera, albedo=albedo, **{**SMALL, "shading": "headlight"})
        for albedo in (colours, colours[:, None])
    ]
    assert (pictures[0] > 0).all()
    assert set(map(tuple, np.sign(pictures[1]).reshape(-1, 3))) == {(1, 0, 0), (0, 1, 0), (1, 1, 0)}


@pytest.mark.parametrize("shading", ["path", "ao", "headlight"])
def test_exposure_scales_by_powers_of_two(shading):
    what = {**SMALL, "shading": shading}
    scene = wive.Scene(*sphere(2))
    plain = wive.render(scene, **what)
    for stops in (1, -2, 0.5):
        np.testing.assert_allclose(wive.render(scene, exposure=stops, **what), plain * 2**stops, rtol=1e-6)
    for darker in (0, -7):
        automatic = wive.render(scene, exposure="auto", albedo=np.full(3, 2.0**darker), **what)
        if shading == "headlight":
            assert np.quantile(automatic[..., 1], 0.9) == pytest.approx(0.7, rel=1e-5)


def test_exposure_leaves_normals_depth_and_black_pictures_alone():
    scene = wive.Scene(*FLOOR)
    for shading in ("normals", "depth"):
        what = {**SMALL, "shading": shading}
        pictures = [wive.render(scene, DOWN, exposure=stops, **what) for stops in (0, 3)]
        np.testing.assert_array_equal(*pictures)
    black = wive.render(scene, DOWN, sky="black", exposure="auto", **SMALL)
    assert (black == 0).all()


@pytest.mark.parametrize("sky", ["day", "cloudy"])
def test_light_and_colours_are_the_same_on_every_backend(usable_backends, sky):
    mesh = joined(FLOOR, box((-1, 0, -1), (1, 2, 1)))
    camera = wive.Camera(eye=(5, 6, 9), target=(0, 1, 0))
    albedo = np.random.default_rng(1).random((len(mesh[1]), 3))
    pictures = [
        wive.render(wive.Scene(*mesh, backend=name), camera, sky=sky, sun=(1, 2, 3), albedo=albedo, **SMALL)
        for name in usable_backends
    ]
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])
