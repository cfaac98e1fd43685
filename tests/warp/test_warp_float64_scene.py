"""A float64 scene on a Warp device: arrays of doubles in and out, and the bits of a scene on the CPU."""

from typing import Any

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.doubles import rays64, soup64, survey
from support.foreign_arrays import Foreign
from support.meshes import assert_same_hits

import wive

pytestmark = pytest.mark.timeout(180)

MESH = soup64(300, seed=1)
RAYS = rays64(500, seed=2)


@pytest.fixture(scope="module")
def scenes() -> tuple[wive.Scene, wive.Scene]:
    return wive.Scene(*MESH, device="cpu"), wive.Scene(*MESH, backend="scalar")


def as_rows(array: Any) -> np.ndarray:
    """An array of Warp, torch, or a library that supports only DLPack, as NumPy's."""
    return array.values if isinstance(array, Foreign.Array) else array.numpy()


def test_numpy_rays_give_the_hits_of_the_cpu(scenes: tuple[wive.Scene, wive.Scene]) -> None:
    on_warp, on_cpu = scenes
    assert on_warp.precision == on_warp.tree.precision == "float64"
    assert on_warp.vertices.dtype == np.float64
    found, expected = on_warp.intersect(*RAYS), on_cpu.intersect(*RAYS)
    assert found.t.dtype == found.uv.dtype == np.float64
    assert_same_hits(found, expected)
    np.testing.assert_array_equal(found.error_bound, expected.error_bound)
    np.testing.assert_array_equal(on_warp.occluded(*RAYS, 0.1, 0.3), on_cpu.occluded(*RAYS, 0.1, 0.3))
    np.testing.assert_array_equal(on_warp.count(*RAYS), on_cpu.count(*RAYS))
    np.testing.assert_array_equal(on_warp.intersect_all(*RAYS).t, on_cpu.intersect_all(*RAYS).t)


@pytest.mark.parametrize("library", ["warp.vec3d", "warp", "torch", "foreign"])
def test_arrays_on_the_device_give_arrays_of_doubles(
    library: str, scenes: tuple[wive.Scene, wive.Scene]
) -> None:
    on_warp, on_cpu = scenes
    if library == "torch":
        rays = [pytest.importorskip("torch").from_numpy(rows) for rows in RAYS]
    elif library == "foreign":
        rays = [Foreign.Array(rows) for rows in RAYS]
    else:
        dtype = wp.vec3d if library == "warp.vec3d" else wp.float64
        rays = [wp.array(rows, dtype=dtype, device="cpu") for rows in RAYS]
    found, expected = on_warp.intersect(*rays), on_cpu.intersect(*RAYS)
    assert type(found.t) is type(rays[0])
    for name in ("t", "prim", "uv", "mask", "error_bound"):
        np.testing.assert_array_equal(as_rows(getattr(found, name)), getattr(expected, name), err_msg=name)
    np.testing.assert_allclose(as_rows(found.points()), expected.points(), rtol=0, atol=1e-15)
    np.testing.assert_allclose(as_rows(found.normals()), expected.normals(), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(as_rows(found.spawn(rays[1])), expected.spawn(RAYS[1]))
    everything, listed = on_warp.intersect_all(*rays), on_cpu.intersect_all(*RAYS)
    for name in ("offsets", "t", "prim", "uv", "counts", "ray"):
        np.testing.assert_array_equal(as_rows(getattr(everything, name)), getattr(listed, name), err_msg=name)
    np.testing.assert_array_equal(as_rows(on_warp.occluded(*rays)), on_cpu.occluded(*RAYS))


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_spawned_origins_in_survey_coordinates_are_those_of_the_cpu(accuracy: str) -> None:
    vertices, faces = survey(2)
    origins = np.tile(vertices.mean(axis=0), (len(vertices), 1))
    directions = vertices - origins
    directions[::3] *= 1e300
    on_cpu = wive.Scene(vertices, faces, backend="scalar", accuracy=accuracy).intersect(origins, directions)
    rays = [wp.array(rows, dtype=wp.vec3d, device="cpu") for rows in (origins, directions)]
    found = wive.Scene(vertices, faces, device="cpu", accuracy=accuracy).intersect(*rays)
    for sign in (1.0, -1.0):
        expected = on_cpu.spawn(sign * directions)
        given = wp.array(sign * directions, dtype=wp.vec3d, device="cpu")
        np.testing.assert_array_equal(as_rows(found.spawn(given)), expected)
        assert (on_cpu.mask.mean() > 0.9) and expected.dtype == np.float64
    np.testing.assert_array_equal(as_rows(found.error_bound), on_cpu.error_bound)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_special_directions_spawn_the_origins_of_the_cpu(dtype: type[np.floating[Any]]) -> None:
    limits = np.finfo(dtype)
    numbers = [0.0, -0.0, np.inf, -np.inf, np.nan, limits.smallest_subnormal, -limits.tiny, limits.max, -1.0]
    directions = np.array(np.meshgrid(numbers, numbers, numbers), dtype).reshape(3, -1).T.copy()
    vertices, faces = (dtype(1e-12) * soup64(1, seed=3)[0].astype(dtype)), np.array([[0, 1, 2]])
    rays = np.full_like(directions, vertices.mean(axis=0) - dtype(1e-12)), np.ones_like(directions)
    vec3 = wp.vec3 if dtype is np.float32 else wp.vec3d
    *given_rays, given = (wp.array(rows, dtype=vec3, device="cpu") for rows in (*rays, directions))
    for accuracy in ("fast", "watertight"):
        expected = wive.Scene(vertices, faces, accuracy=accuracy).intersect(*rays)
        found = wive.Scene(vertices, faces, device="cpu", accuracy=accuracy).intersect(*given_rays)
        assert expected.mask.all() and expected.t.dtype == dtype
        origins = expected.spawn(directions)
        assert len(np.unique(origins, axis=0)) == 2  # both sides
        np.testing.assert_array_equal(as_rows(found.spawn(given)), origins)


@pytest.mark.parametrize("dtype", [wp.vec3, wp.float32])
def test_rays_of_float32_on_the_device_are_refused_in_one_line(
    dtype: type, scenes: tuple[wive.Scene, wive.Scene]
) -> None:
    rays = [wp.array(rows.astype(np.float32), dtype=dtype, device="cpu") for rows in RAYS]
    message = (
        r"^origins must be float64 on a Warp device, where nothing is converted, got .*: convert it first$"
    )
    with pytest.raises(TypeError, match=message):
        scenes[0].intersect(*rays)


def test_refit_keeps_doubles_on_the_device() -> None:
    vertices, faces = survey(1)
    on_warp, on_cpu = wive.Scene(vertices, faces, device="cpu"), wive.Scene(vertices, faces)
    rays = vertices.mean(axis=0), vertices - vertices.mean(axis=0)
    for scene in (on_warp, on_cpu):
        scene.refit(vertices * (1 + 1e-9))
    assert_same_hits(on_warp.intersect(*rays), on_cpu.intersect(*rays))
