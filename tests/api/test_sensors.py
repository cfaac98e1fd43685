# ruff: noqa: E501
"""Rays of cameras and lidars: where they hit agrees with the projection that each sensor is defined by."""

import ctypes

import numpy as np
import pytest
from support.meshes import sphere

import wive
from wive import _cpu

WIDTH, HEIGHT = 24, 16
CAMERA = wive.Camera(eye=(1, -4, 2.5), target=(0, 0.5, 0), up=(0, 0, 1), fov=50)
# A ball round the sensors, so that every ray hits.
AROUND = wive.Scene(sphere(3, 40)[0].astype(np.float64), sphere(3)[1])
TRACER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_size_t,
    ctypes.POINTER(ctypes.c_float), ctypes.POINTER(ctypes.c_float), ctypes.c_float, ctypes.c_float,
    ctypes.POINTER(ctypes.c_float), ctypes.POINTER(ctypes.c_int32), ctypes.POINTER(ctypes.c_float),
)  # fmt: skip


def turned(seed: int = 1) -> np.ndarray:
    """A pose (4,4): a random rotation and place."""
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.standard_normal((3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.linalg.det(rotation)
    pose[:3, 3] = random.uniform(-5, 5, 3)
    return pose


def in_sensor(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """World points in the sensor's own axes."""
    extrinsic = np.linalg.inv(pose)
    return points @ extrinsic[:3, :3].T + extrinsic[:3, 3]


def pixels() -> tuple[np.ndarray, np.ndarray]:
    """(h,w) column and row of each pixel."""
    column, row = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    return column, row


def rays_of_the_renderer(frame: np.ndarray, samples: int) -> np.ndarray:
    """(h,w,samples,3) directions that pictures are rendered with: each somewhere in its pixel."""
    seen = []

    @TRACER
    def trace(context, count, origins, directions, tmin, tmax, t, prim, uv):
        seen.append(np.ctypeslib.as_array(directions, (count, 3)).copy())
        np.ctypeslib.as_array(prim, (count,))[:] = -1

    image = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    tracer = ctypes.cast(trace, ctypes.c_void_p).value, 0
    bvh = _cpu.Bvh(*sphere(1))
    for row in range(HEIGHT):
        what = row, row + 1, samples, 0, "gray", 7
        bvh.render_rows("scalar", frame, image, *what, tracer=tracer, threads=1)
    return np.concatenate(seen).reshape(HEIGHT, WIDTH, samples, 3)


@pytest.mark.parametrize(
    "camera",
    [CAMERA, wive.PinholeCamera((30, 25, 9.5, 8.25), turned())],
    ids=["Camera", "PinholeCamera"],
)
def test_rays_go_through_the_centres_of_the_renderers_pixels(camera):
    samples = 64
    used = rays_of_the_renderer(camera.frame(WIDTH, HEIGHT), samples).astype(np.float64)
    origins, directions = camera.rays(WIDTH, HEIGHT)
    np.testing.assert_allclose(
        origins, np.broadcast_to(camera.frame(WIDTH, HEIGHT)[0], origins.shape), rtol=1e-6
    )
    # The picture's plane: depth 1 along the normal to the two ways in which neighbours differ.
    across, down = directions[0, 1] - directions[0, 0], directions[1, 0] - directions[0, 0]
    normal = np.cross(across, down)
    on_plane = used * (directions[0, 0] @ normal / (used @ normal))[..., None]
    away = on_plane - directions[:, :, None]
    columns, rows = away @ across / (across @ across), away @ down / (down @ down)
    for offsets in (columns, rows):
        assert -0.5001 < offsets.min() < -0.49
        assert 0.49 < offsets.max() < 0.5001
        assert abs(offsets.mean(axis=-1)).max() < 0.2  # 1/sqrt(12 * 64) is 0.036


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_t_of_a_cameras_rays_is_the_depth_along_its_axis(dtype):
    origins, directions = CAMERA.rays(WIDTH, HEIGHT, dtype)
    assert origins.dtype == directions.dtype == dtype
    assert origins.shape == directions.shape == (HEIGHT, WIDTH, 3)
    assert origins.flags.c_contiguous
    assert directions.flags.c_contiguous
    hits = AROUND.intersect(origins, directions)
    view = np.subtract(CAMERA.target, CAMERA.eye)
    depth = (hits.points() - CAMERA.eye) @ view / np.linalg.norm(view)
    np.testing.assert_allclose(hits.t, depth, rtol=1e-5 if dtype is np.float32 else 1e-13)


def test_a_cameras_picture_is_upright():
    directions = CAMERA.rays(WIDTH, HEIGHT)[1]
    right = np.cross(np.subtract(CAMERA.target, CAMERA.eye), CAMERA.up)
    assert (np.diff(directions @ right, axis=1) > 0).all()
    assert (np.diff(directions[..., 2], axis=0) < 0).all()
    edge = directions[0, :, :].mean(axis=0) - directions.mean(axis=(0, 1))
    assert np.linalg.norm(edge) * HEIGHT / (HEIGHT - 1) == pytest.approx(np.tan(np.radians(25)))


@pytest.mark.parametrize(
    "intrinsics",
    [(30, 25, 9.5, 8.25), [[30, 1.5, 9.5], [0, 25, 8.25], [0, 0, 1]], (5, 400, -50, 1000)],
    ids=["four numbers", "a matrix with skew", "far off centre"],
)
@pytest.mark.parametrize("pose", [None, turned(2), turned(3).astype(np.float32)])
def test_what_a_calibrated_camera_sees_is_projected_to_its_pixels(intrinsics, pose):
    camera = wive.PinholeCamera(intrinsics, pose)
    hits = AROUND.intersect(*camera.rays(WIDTH, HEIGHT))
    assert hits.mask.all()
    x, y, z = np.moveaxis(in_sensor(hits.points(), np.eye(4) if pose is None else pose), -1, 0)
    exact = pose is None or pose.dtype == np.float64  # a pose of float32 is not quite a rotation
    np.testing.assert_allclose(z, hits.t, rtol=1e-9 if exact else 1e-5)
    matrix = np.asarray(intrinsics, float)
    if matrix.ndim == 1:
        fx, fy, cx, cy = matrix
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    found = np.stack([x / z, y / z, np.ones_like(z)], axis=-1) @ matrix.T
    np.testing.assert_allclose(found[..., :2], np.stack(pixels(), axis=-1), atol=1e-8 if exact else 2e-3)


def test_a_camera_is_the_calibrated_one_of_its_field_of_view():
    forward, right, top = CAMERA._axes()
    pose = np.eye(4)
    pose[:3] = np.column_stack([right, -top, forward, CAMERA.eye])
    focal = HEIGHT / 2 / np.tan(np.radians(CAMERA.fov) / 2)
    same = wive.PinholeCamera((focal, focal, (WIDTH - 1) / 2, (HEIGHT - 1) / 2), pose)
    for one, other in zip(same.rays(WIDTH, HEIGHT), CAMERA.rays(WIDTH, HEIGHT), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-13)
    scene = wive.Scene(*sphere(2))
    pictures = [wive.render(scene, camera, width=WIDTH, height=HEIGHT, spp=16) for camera in (same, CAMERA)]
    np.testing.assert_allclose(*pictures, atol=0.2)
    assert abs(pictures[0] - pictures[1]).mean() < 1e-3


def test_an_orthographic_picture_is_a_map_of_heights():
    z = np.arange(WIDTH * HEIGHT, dtype=np.float64).reshape(HEIGHT, WIDTH)
    column, row = pixels()
    corners = np.stack([column, -row, z], axis=-1).reshape(-1, 1, 3)
    small = np.array([[-0.1, -0.1, 0], [0.2, -0.1, 0], [-0.1, 0.2, 0]])
    scene = wive.Scene((corners + small).reshape(-1, 3), np.arange(3 * z.size).reshape(-1, 3))
    middle = np.array([(WIDTH - 1) / 2, -(HEIGHT - 1) / 2, 0])
    camera = wive.OrthographicCamera(np.add(middle, (0, 0, 1000)), middle, up=(0, 1, 0), view_height=HEIGHT)
    hits = scene.intersect(*camera.rays(WIDTH, HEIGHT))
    np.testing.assert_array_equal(hits.prim, np.arange(z.size).reshape(HEIGHT, WIDTH))
    np.testing.assert_allclose(1000 - hits.t, z, atol=1e-9)


def test_an_equirectangular_picture_has_longitudes_as_columns_and_latitudes_as_rows():
    camera = wive.EquirectangularCamera((1, 2, 3), (1, 5, 3), up=(0, 0, 2))
    origins, directions = camera.rays(WIDTH, HEIGHT)
    hits = AROUND.intersect(origins, directions)
    x, y, z = np.moveaxis(hits.points() - (1, 2, 3), -1, 0)  # x is right, y is the view, z is up
    np.testing.assert_allclose(hits.t, np.sqrt(x**2 + y**2 + z**2), rtol=1e-12)
    column, row = pixels()
    np.testing.assert_allclose(np.degrees(np.arctan2(x, y)), (column + 0.5) / WIDTH * 360 - 180, atol=1e-9)
    np.testing.assert_allclose(np.degrees(np.arcsin(z / hits.t)), 90 - (row + 0.5) / HEIGHT * 180, atol=1e-9)


@pytest.mark.parametrize("pose", [None, turned(5)])
@pytest.mark.parametrize("azimuths", [20, np.linspace(30, -330, 20)])
def test_a_lidars_range_image_has_beams_as_rows_and_steps_as_columns(azimuths, pose):
    elevations = np.array([15.0, 3, -2, -25])
    lidar = wive.SpinningLidar(elevations, azimuths, pose)
    hits = AROUND.intersect(*lidar.rays())
    assert hits.t.shape == (4, 20)
    x, y, z = np.moveaxis(in_sensor(hits.points(), np.eye(4) if pose is None else pose), -1, 0)
    np.testing.assert_allclose(hits.t, np.sqrt(x**2 + y**2 + z**2), rtol=1e-12)
    np.testing.assert_allclose(
        np.degrees(np.arcsin(z / hits.t)), np.broadcast_to(elevations[:, None], (4, 20)), atol=1e-9
    )
    expected = np.arange(20) * 18.0 if isinstance(azimuths, int) else azimuths
    turn = np.degrees(np.arctan2(y, x)) - expected
    np.testing.assert_allclose((turn + 180) % 360 - 180, np.zeros((4, 20)), atol=1e-9)
    assert lidar.rays(np.float32)[1].dtype == np.float32


NAN = float("nan")
MIRRORED, SCALED, SHEARED = np.diag([1, 1, -1.0, 1]), np.diag([2, 2, 2.0, 1]), np.eye(4)
SHEARED[0, 1] = 0.1


@pytest.mark.parametrize(
    ("make", "kind", "message"),
    [
        (lambda: CAMERA.rays(0, 4), ValueError, "width must be from 1 to 65536, got 0"),
        (lambda: CAMERA.rays(4, 4.0), TypeError, "height must be an integer, got float 4.0"),
        (lambda: CAMERA.rays(70_000, 4), ValueError, "width must be from 1 to 65536, got 70000"),
        (lambda: CAMERA.rays(4, 4, np.int32), ValueError, "dtype must be float32 or float64, got "),
        (lambda: wive.PinholeCamera((1, 2, 3)), ValueError, "intrinsics must be (fx, fy, cx, cy) or a (3, 3) matrix, got shape (3,)"),
        (lambda: wive.PinholeCamera((0, 2, 3, 3)), ValueError, "intrinsics must have fx and fy above 0, got 0 and 2"),
        (lambda: wive.PinholeCamera((1, -2, 3, 3)), ValueError, "intrinsics must have fx and fy above 0, got 1 and -2"),
        (lambda: wive.PinholeCamera((1, NAN, 3, 3)), ValueError, "intrinsics must be (fx, fy, cx, cy) or a (3, 3) matrix of finite numbers"),
        (lambda: wive.PinholeCamera(np.eye(3).T + np.eye(3)[::-1]), ValueError, "intrinsics must be a matrix of the rows fx, skew, cx; 0, fy, cy; 0, 0, 1"),
        (lambda: wive.PinholeCamera("K"), TypeError, "intrinsics must be an array of real numbers, got dtype <U1"),
        (lambda: wive.PinholeCamera((1, 1, 0, 0), np.eye(3)), ValueError, "pose must be a (4, 4) matrix, sensor to world, got shape (3, 3)"),
        (lambda: wive.PinholeCamera((1, 1, 0, 0), MIRRORED), ValueError, "pose must be a rotation without scale or mirror"),
        (lambda: wive.PinholeCamera((1, 1, 0, 0), SCALED), ValueError, "pose must be a rotation without scale or mirror"),
        (lambda: wive.PinholeCamera((1, 1, 0, 0), SHEARED), ValueError, "pose must be a rotation without scale or mirror"),
        (lambda: wive.PinholeCamera((1, 1, 0, 0), turned().T), ValueError, "pose must be a rotation without scale or mirror"),
        (lambda: wive.PinholeCamera((1, 1, 0, 0), np.full((4, 4), NAN)), ValueError, "pose must be a (4, 4) matrix of finite numbers"),
        (lambda: wive.OrthographicCamera((0, 0, 0), (0, 0, 0)), ValueError, "eye and target must differ"),
        (lambda: wive.OrthographicCamera((0, 0, 1), (0, 0, 0), view_height=0), ValueError, "view_height must be above 0, got 0"),
        (lambda: wive.EquirectangularCamera((0, 1, 0), (0, 0, 0)), ValueError, "up must not be zero or along the view"),
        (lambda: wive.SpinningLidar(15, 100), ValueError, "elevations must be (n,) angles in degrees, got shape ()"),
        (lambda: wive.SpinningLidar([15], 100.0), ValueError, "azimuths must be (n,) angles in degrees or their number, got shape ()"),
        (lambda: wive.SpinningLidar([15], 0), ValueError, "azimuths must be from 1 to 65536, got 0"),
        (lambda: wive.SpinningLidar([15], [0, NAN]), ValueError, "azimuths must be finite, got [0.0, nan]"),
        (lambda: wive.SpinningLidar([[1], [1, 2]], 4), ValueError, "elevations must be an array of real numbers, got rows of unequal length"),
        (lambda: wive.SpinningLidar([15], 4, np.zeros(16)), ValueError, "pose must be a (4, 4) matrix, sensor to world, got shape (16,)"),
        (lambda: wive.render(wive.Scene(*sphere(1)), wive.OrthographicCamera((0, 0, 1), (0, 0, 0))), TypeError, "camera must be a wive.Camera or wive.PinholeCamera"),
    ],
)  # fmt: skip
def test_sensors_of_no_sense_are_refused_in_one_line(make, kind, message):
    with pytest.raises(kind) as error:
        make()
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)
