"""The default camera: outside of objects, within rooms."""

import numpy as np
import pytest
from support.meshes import soup, sphere
from support.rooms import box, joined, room

import wive

ASPECT = 16 / 9


def is_within(camera: wive.Camera, mesh) -> bool:
    low, high = mesh[0].min(axis=0), mesh[0].max(axis=0)
    return bool(((camera.eye > low) & (camera.eye < high)).all())


def share_seen(mesh, camera: wive.Camera) -> float:
    """The share of the area that a picture shows."""
    scene = wive.Scene(*mesh)
    random = np.random.default_rng(1)
    a, b, c = (mesh[0][mesh[1][:, k]].astype(np.float64) for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    prim = random.choice(len(area), 4000, p=area / area.sum())
    uv = random.random((4000, 2))
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
    points = (1 - uv.sum(axis=1, keepdims=True)) * a[prim] + uv[:, :1] * b[prim] + uv[:, 1:] * c[prim]
    eye, forward, right, top = camera.frame(1600, 900).astype(np.float64)
    views = points - eye
    depth = views @ forward
    inside = (depth > 0) & (abs(views @ right) < depth * (right @ right))
    inside &= abs(views @ top) < depth * (top @ top)
    return float((inside & scene.visible(eye, points)).mean())


@pytest.mark.parametrize("up", [1, 2])
@pytest.mark.parametrize("size", [(6, 2.6, 4), (12, 3, 5), (5, 3, 5)])
def test_the_camera_stands_in_a_room_upright_and_sees_most_of_it(up, size):
    mesh = room(up, size)
    camera = wive.Camera.showing(wive.Scene(*mesh), aspect=ASPECT)
    assert is_within(camera, mesh)
    assert np.asarray(camera.up).tolist() == [0, up == 1, up == 2]
    assert share_seen(mesh, camera) > 0.4
    height = (camera.eye[up] - mesh[0][:, up].min()) / np.ptp(mesh[0][:, up])
    assert 0.2 < height < 0.85


def test_a_room_with_an_open_side_is_looked_into_from_within():
    mesh = room(without=4)
    camera = wive.Camera.showing(wive.Scene(*mesh))
    assert is_within(camera, mesh)
    assert share_seen(mesh, camera) > 0.45


def test_a_box_turned_inside_out_is_a_room_and_a_box_is_an_object():
    inside_out, plain = box((0, 0, 0), (5, 3, 4), inwards=True), box((0, 0, 0), (5, 3, 4))
    assert is_within(wive.Camera.showing(wive.Scene(*inside_out)), inside_out)
    assert not is_within(wive.Camera.showing(wive.Scene(*plain)), plain)


@pytest.mark.parametrize("backend_options", [{}, {"backend": "scalar"}, {"accuracy": "exact"}])
def test_the_camera_is_the_same_at_each_call_and_on_every_backend(backend_options):
    mesh = room()
    first = wive.Camera.showing(wive.Scene(*mesh))
    again = wive.Camera.showing(wive.Scene(*mesh, **backend_options))
    np.testing.assert_array_equal(first.frame(64, 36), again.frame(64, 36))


@pytest.mark.parametrize(
    "mesh",
    [
        sphere(3),
        soup(2000, seed=1),
        joined(sphere(3), (0.9 * sphere(3)[0], sphere(3)[1][:, ::-1])),  # a hollow ball
        joined(box((0, 0, 0), (1, 1, 1)), box((3, 0, 0), (4, 2, 1))),
    ],
    ids=["sphere", "soup", "shell", "boxes"],
)
def test_objects_are_framed_from_outside_and_fill_the_picture(mesh):
    scene = wive.Scene(*mesh)
    camera = wive.Camera.showing(scene, aspect=ASPECT)
    assert not is_within(camera, mesh)
    eye, forward, right, top = camera.frame(1600, 900).astype(np.float64)
    views = mesh[0][mesh[1].reshape(-1)] - eye
    depth = views @ forward
    x, y = views @ right / (right @ right) / depth, views @ top / (top @ top) / depth
    assert (depth > 0).all() and max(abs(x).max(), abs(y).max()) <= 1
    assert max(abs(x).max(), abs(y).max()) > 0.85


def test_flat_land_is_seen_from_above_with_its_thin_axis_up():
    x = np.arange(60.0)
    hills = np.sin(x[:, None] / 5) * np.cos(x / 7)
    scene = wive.Scene.from_heightfield(hills.astype(np.float32), x.astype(np.float32), x.astype(np.float32))
    camera = wive.Camera.showing(scene)
    assert np.asarray(camera.up).tolist() == [0, 0, 1]
    assert camera.eye[2] > 20
    picture = wive.render(scene, camera, shading="depth", width=64, height=36)
    assert np.isfinite(picture).mean() > 0.3


def test_detail_on_a_large_ground_is_framed_and_not_the_ground():
    vertices, faces = sphere(4)
    ground = np.float32([[-300, -1, -300], [300, -1, -300], [300, -1, 300], [-300, -1, 300]])
    mesh = joined((vertices, faces), (ground, np.int32([[0, 2, 1], [0, 3, 2]])))
    camera = wive.Camera.showing(wive.Scene(*mesh))
    assert np.linalg.norm(camera.eye) < 10


def test_up_fov_and_aspect_are_those_that_are_asked_for():
    for mesh in (room(), sphere(2)):
        camera = wive.Camera.showing(wive.Scene(*mesh), up=(0, 0, 3), fov=75, aspect=0.5)
        assert camera.fov == 75
        np.testing.assert_allclose(np.cross(camera.up, (0, 0, 1)), 0, atol=1e-12)
    for options in ({"fov": 0}, {"aspect": 0}, {"up": (0, 0, 0)}, {"aspect": "wide"}):
        with pytest.raises((TypeError, ValueError), match=next(iter(options))):
            wive.Camera.showing(wive.Scene(*room()), **options)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_rooms_of_any_size_and_place_are_looked_into(scale):
    vertices, faces = room()
    mesh = (vertices * np.float32(scale), faces)
    assert is_within(wive.Camera.showing(wive.Scene(*mesh)), mesh)
    mesh = (vertices + np.array([4.5e6, 5e5, 100]), faces)
    assert is_within(wive.Camera.showing(wive.Scene(*mesh)), mesh)


def test_degenerate_scenes_have_a_camera_or_one_clear_line():
    flat = wive.Scene(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]]), [[0, 1, 2], [3, 3, 3]])
    assert wive.render(flat, width=8, height=8, spp=1).shape == (8, 8, 3)
    for scene in (wive.Scene([], []), wive.Scene([[0, 0, 0]], [[0, 0, 0]])):
        with pytest.raises(ValueError, match="bounds must be finite to be framed"):
            wive.Camera.showing(scene)
