"""Pictures by ambient occlusion, a headlight, normals and depth."""

import numpy as np
import pytest
from support.meshes import sphere
from support.rooms import box, room

import wive
from wive._internal.pictures import shades

FLOOR = (
    np.array([[-1000, 0, -1000], [1000, 0, -1000], [1000, 0, 1000], [-1000, 0, 1000]], np.float32),
    np.array([[0, 2, 1], [0, 3, 2]], np.int32),
)
DOWN = wive.Camera(eye=(0, 10, 0), target=(0, 0, 0), up=(0, 0, -1))
SMALL = {"width": 40, "height": 24, "spp": 8}
INSIDE = wive.Camera(eye=(2, 1.2, 3.4), target=(4, 1, 0), fov=70)


def test_a_plane_under_the_open_sky_has_no_occlusion(backend):
    assert (wive.render(wive.Scene(*FLOOR, backend=backend), DOWN, shading="ao", **SMALL) == 1).all()


def test_a_closed_box_is_all_occluded_unless_the_reach_is_shorter_than_the_walls_are_far(backend):
    scene = wive.Scene(*box((0, 0, 0), (6, 3, 4), inwards=True), backend=backend)
    whole = wive.render(scene, INSIDE, shading="ao", reach=np.inf, **SMALL)
    assert (whole == 0).all()
    near = wive.render(scene, INSIDE, shading="ao", reach=0.5, **SMALL)
    assert (near.max(axis=(0, 1)) == 1).all() and 0.7 < near.mean() < 1


def test_a_wall_occludes_half_of_the_sky_at_its_foot(backend):
    ground, wall = FLOOR, (np.float32([[0, 0, -1e3], [0, 0, 1e3], [0, 1e3, -1e3], [0, 1e3, 1e3]]))
    vertices = np.concatenate([ground[0], wall])
    faces = np.concatenate([ground[1], np.int32([[4, 5, 6], [5, 7, 6]])])
    camera = wive.Camera(eye=(0.01, 1, 0), target=(0.01, 0, 0), up=(0, 0, -1), fov=0.1)
    picture = wive.render(wive.Scene(vertices, faces, backend=backend), camera, shading="ao", **SMALL)
    assert picture.mean() == pytest.approx(0.5, abs=0.02)


def test_occlusion_within_a_reach_grows_with_nearness():
    """From a floor to a ceiling at height h, a ray of cosine c goes h / c."""
    high, reach = 1.0, 3.0
    vertices = np.concatenate([FLOOR[0], FLOOR[0] + np.float32([0, high, 0])])
    scene = wive.Scene(vertices, np.concatenate([FLOOR[1], FLOOR[1] + 4]))
    camera = wive.Camera(eye=(0, 0.9, 0), target=(0, 0, 0), up=(0, 0, -1), fov=20)
    picture = wive.render(scene, camera, shading="ao", reach=reach, width=64, height=64, spp=64)
    cosines = np.sqrt((np.arange(100_000) + 0.5) / 100_000)  # cosine-distributed
    assert picture.mean() == pytest.approx(np.minimum(1, high / (cosines * reach)).mean(), abs=2e-3)


def test_a_headlight_is_the_cosine_between_view_and_normal(backend):
    scene = wive.Scene(*sphere(4), backend=backend)
    camera = wive.Camera(eye=(0, 0, 5), target=(0, 0, 0), fov=30)
    picture = wive.render(scene, camera, shading="headlight", width=33, height=33, spp=64)
    hits = scene.intersect(*camera.rays(33, 33))
    steady = hits.mask & (hits.cosines() > 0.8)  # elsewhere a pixel has many cosines
    np.testing.assert_allclose(picture[steady, 0], hits.cosines()[steady], atol=0.04)
    assert (picture[0, 0] == 0).all()


def test_a_headlight_lights_both_sides_and_a_plane_seen_at_an_angle_by_its_cosine():
    for up in (1, -1):
        eye = np.array([0, up * np.cos(1), np.sin(1)]) * 10
        camera = wive.Camera(eye=eye, target=(0, 0, 0), up=(1, 0, 0), fov=0.001)
        picture = wive.render(wive.Scene(*FLOOR), camera, shading="headlight", **SMALL)
        np.testing.assert_allclose(picture, np.cos(1), atol=1e-4)


def test_normals_are_coloured_by_direction_whichever_side_is_seen(backend):
    scene = wive.Scene(*FLOOR, backend=backend)
    below = wive.Camera(eye=(0, -10, 0), target=(0, 0, 0), up=(0, 0, 1))
    for camera in (DOWN, below):
        picture = wive.render(scene, camera, shading="normals", **SMALL)
        np.testing.assert_array_equal(picture, np.broadcast_to([0.5, 1, 0.5], picture.shape))


def test_depth_is_t_along_the_axis_and_inf_where_nothing_is(backend):
    scene = wive.Scene(*sphere(3), backend=backend)
    for camera in (
        wive.Camera(eye=(1, 2, 4), target=(0, 0.2, 0)),
        wive.PinholeCamera(
            (50, 50, 19.5, 11.5), np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -3], [0, 0, 0, 1]])
        ),
    ):
        picture = wive.render(scene, camera, shading="depth", **SMALL)
        t = scene.intersect(*camera.rays(40, 24, np.float32)).t
        assert picture.shape == (24, 40) and picture.dtype == np.float32
        np.testing.assert_array_equal(picture, t)
        assert np.isinf(picture).any() and np.isfinite(picture).any()


def test_depth_of_a_plane_across_the_axis_is_one_number():
    picture = wive.render(wive.Scene(*FLOOR), DOWN, shading="depth", **SMALL)
    np.testing.assert_allclose(picture, 10, rtol=1e-6)


@pytest.mark.parametrize("shading", ["ao", "headlight", "normals", "depth"])
def test_a_picture_depends_on_neither_backend_nor_threads_nor_bands(usable_backends, monkeypatch, shading):
    mesh = room()
    what = {"shading": shading, "width": 33, "height": 19, "spp": 5, "reach": 1.5, "seed": 3}
    first = wive.render(wive.Scene(*mesh, backend=usable_backends[0]), INSIDE, threads=1, **what)
    for name in usable_backends:
        options = {} if name == "warp" else {"threads": 5}
        found = wive.render(wive.Scene(*mesh, backend=name), INSIDE, **options, **what)
        np.testing.assert_array_equal(found, first)
    monkeypatch.setattr(shades, "BAND_PIXELS", 70)
    np.testing.assert_array_equal(wive.render(wive.Scene(*mesh), INSIDE, **what), first)
    if shading != "depth":
        assert (wive.render(wive.Scene(*mesh), INSIDE, **{**what, "seed": 4}) != first).any()


def test_a_float64_scene_far_from_the_origin_has_the_picture_of_a_float32_scene_at_it():
    vertices, faces = room()
    place = np.array([4.5e6, 5.1e5, 300.0])
    camera = wive.Camera(INSIDE.eye + place, INSIDE.target + place, fov=INSIDE.fov)
    for shading in ("ao", "headlight", "normals", "depth"):
        what = {"shading": shading, "width": 40, "height": 24, "spp": 16, "reach": 1.5}
        near = wive.render(wive.Scene(vertices, faces), INSIDE, **what)
        far = wive.render(wive.Scene(vertices + place, faces), camera, **what)
        assert (abs(near - far) < 0.02).mean() > 0.9


def test_fewer_samples_than_a_points_rays_are_traced_as_such():
    settings = wive._internal.picture.Settings(shading="ao", width=8, height=8, spp=1)
    scene = wive.Scene(*FLOOR)
    assert wive.rendering.render_counted(scene, DOWN, settings, progress=False).rays == 2 * 64


@pytest.mark.parametrize("shading", ["auto", "path", "ao", "headlight", "normals", "depth"])
def test_all_rays_of_a_picture_are_traced_on_the_threads_that_are_asked_for(monkeypatch, shading):
    """Queries whose options are all the usual ones take a shorter way."""
    usual = []
    scene = wive.Scene(*room())
    monkeypatch.setattr(type(scene._tracer), "at_once", lambda self, *arguments: usual.append(arguments))
    wive.render(scene, shading=shading, threads=1, **SMALL)
    assert usual == []
    wive.render(scene, shading=shading, **SMALL)
    assert usual


def test_a_picture_shows_one_shape_whatever_refits_happen_meanwhile(monkeypatch):
    vertices, faces = FLOOR
    scene = wive.Scene(vertices, faces)
    monkeypatch.setattr(shades, "BAND_PIXELS", 1)
    seen = shades.Band.hits

    def hits(self, *arguments):
        scene.refit(vertices - np.float32([0, 5, 0]))
        return seen(self, *arguments)

    monkeypatch.setattr(shades.Band, "hits", hits)
    wive.render(scene, DOWN, shading="headlight", **SMALL)
    assert (wive.render(scene, DOWN, shading="depth", **SMALL) > 14.9).all()


class TestAutomaticShading:
    @staticmethod
    def chosen(scene, camera=None, **options):
        settings = wive._internal.picture.Settings(width=24, height=16, spp=4, **options)
        return wive.rendering.render_counted(scene, camera, settings, progress=False)

    def test_inside_it_is_occlusion_that_is_not_dark(self):
        found = self.chosen(wive.Scene(*room()), INSIDE)
        assert found.shading == "ao" and found.image.mean() > 0.3

    def test_in_the_open_it_is_path_tracing(self):
        assert self.chosen(wive.Scene(*sphere(2))).shading == "path"
        assert self.chosen(wive.Scene(*FLOOR), DOWN).shading == "path"

    def test_where_no_path_reaches_the_sky_it_is_occlusion(self):
        """The camera looks through a keyhole: all around it is sky, and nothing of that lights the box."""
        scene = wive.Scene(*box((-1, -1, -1), (1, 1, 1)))
        through = wive.Camera(eye=(0, 0, 0.9), target=(0, 0, 0))
        assert self.chosen(scene, through).shading == "ao"
        assert self.chosen(wive.Scene(*FLOOR), DOWN, bounces=0).shading == "ao"

    def test_float64_scenes_have_occlusion(self):
        vertices, faces = sphere(2)
        assert self.chosen(wive.Scene(vertices.astype(np.float64), faces)).shading == "ao"

    def test_a_room_that_is_seen_from_outside_is_lit_by_the_sky(self):
        scene = wive.Scene(*room(without=5))
        assert self.chosen(scene, wive.Camera(eye=(3, 1.3, 9), target=(3, 1.3, 0))).shading == "path"
