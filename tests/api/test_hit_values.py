# ruff: noqa: E501
"""What hits tell of sides, angles and values at vertices: against fractions and plain formulas, per hit."""

from fractions import Fraction

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import random_rays, soup, sphere

import wive
from wive._internal.sides import meets_front


def exact_side(corners: np.ndarray, direction: np.ndarray) -> Fraction:
    """normal . direction in fractions."""
    a, b, c = ([Fraction(float(x)) for x in corner] for corner in corners)
    one, other = [y - x for x, y in zip(a, b)], [y - x for x, y in zip(a, c)]  # noqa: B905
    d = [Fraction(float(x)) for x in direction]
    return (
        d[0] * (one[1] * other[2] - one[2] * other[1])
        + d[1] * (one[2] * other[0] - one[0] * other[2])
        + d[2] * (one[0] * other[1] - one[1] * other[0])
    )


def assert_sides_are_exact(hits: wive.Hits, directions: np.ndarray) -> None:
    for prim, front, direction in zip(hits.prim, hits.front, directions, strict=True):
        if prim < 0:
            assert not front
        else:
            assert front == (exact_side(hits.vertices[hits.faces[prim]], direction) < 0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_front_is_the_side_that_the_normal_points_to(backend, dtype):
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=backend)
    origins, directions = random_rays(300, seed=4, dtype=dtype)
    away = 4 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    outside = scene.intersect(away, origins / 4 - away)
    inside = scene.intersect(origins / 10, directions)
    assert outside.front.dtype == np.bool_
    assert outside.mask.any()
    assert outside.front[outside.mask].all()
    assert inside.mask.all()
    assert not inside.front.any()
    turned = wive.Scene(vertices.astype(dtype), faces[:, ::-1], backend=backend)
    assert turned.intersect(origins / 10, directions).front.all()
    assert not turned.intersect(away, origins / 4 - away).front.any()
    assert_sides_are_exact(scene.intersect(origins, directions), directions)


def flat_rays(vertices, faces, dtype) -> tuple[np.ndarray, np.ndarray]:
    """A ray in the plane of each triangle, up to rounding, through its middle."""
    random = np.random.default_rng(9)
    a, b, c = vertices[faces].astype(np.float64).swapaxes(0, 1)
    u, v = random.uniform(-1, 1, (2, len(faces), 1))
    directions = (u * (b - a) + v * (c - a)).astype(dtype)
    return ((a + b + c) / 3 - directions).astype(dtype), directions


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shift", [0, 1e5])
def test_front_of_rays_in_the_plane_but_for_rounding_is_exact(dtype, shift):
    vertices, faces = soup(400, seed=5, dtype=dtype)
    vertices = (vertices + dtype(shift)).astype(dtype)
    _, directions = flat_rays(vertices, faces, dtype)
    front = meets_front(vertices, faces, np.arange(400, dtype=np.int32), directions)
    signs = [exact_side(vertices[faces[i]], directions[i]) for i in range(400)]
    np.testing.assert_array_equal(front, [sign < 0 for sign in signs])
    assert 100 < np.count_nonzero(front) < 300
    in_double = np.einsum("ij,ij->i", np.cross(*np.diff(vertices[faces], axis=1).swapaxes(0, 1)), directions)
    if dtype is np.float64:
        assert np.count_nonzero((in_double < 0) != front) > 10  # plain arithmetic gets these wrong


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_front_of_grazing_hits_is_exact_on_every_backend(backend, dtype):
    vertices, faces = soup(400, seed=5, dtype=dtype)
    origins, directions = flat_rays(vertices, faces, dtype)
    hits = wive.Scene(vertices, faces, backend=backend).intersect(origins, directions)
    assert np.count_nonzero(hits.mask) > 100
    assert_sides_are_exact(hits, directions)


@pytest.mark.parametrize("scale", [1e-30, 1e-12, 1, 1e12])
def test_front_does_not_under_or_overflow(scale):
    vertices, faces = sphere(1)
    vertices, origins = vertices.astype(np.float64) * scale, random_rays(50, seed=2, dtype=np.float64)[0]
    for length in (1e-300, 1, 1e300):
        hits = wive.Scene(vertices, faces).intersect(4 * scale * origins, -origins * length)
        assert hits.mask.any()
        np.testing.assert_array_equal(hits.front, hits.mask)
        np.testing.assert_allclose(
            hits.cosines(), wive.Scene(vertices, faces).intersect(4 * scale * origins, -origins).cosines()
        )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_cosines_are_those_of_the_angle_to_the_normal(backend, dtype):
    vertices, faces = soup(200, seed=6, dtype=dtype)
    origins, directions = random_rays(300, seed=7, dtype=dtype)
    hits = wive.Scene(vertices, faces, backend=backend).intersect(origins, directions)
    cosines, normals = hits.cosines(), hits.normals()
    assert cosines.dtype == np.float64
    assert hits.mask.any()
    for i in range(300):
        if not hits.mask[i]:
            assert np.isnan(cosines[i])
            continue
        d = directions[i].astype(np.float64)
        across = np.linalg.norm(np.cross(normals[i], d / np.linalg.norm(d)))
        assert np.hypot(across, cosines[i]) == pytest.approx(1, abs=1e-12)
        assert 0 <= cosines[i] <= 1
        assert cosines[i] == pytest.approx(abs(normals[i] @ d) / np.linalg.norm(d), abs=1e-14)


def test_a_ray_at_a_right_angle_has_cosine_1():
    scene = wive.Scene([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [[0, 1, 2]])
    hits = scene.intersect([[0, 0, 5]] * 3, [[0, 0, -1], [0, 0, -1e-30], [0, 0, 1]])
    np.testing.assert_array_equal(hits.cosines(), [1, 1, np.nan])
    np.testing.assert_array_equal(hits.front, [True, True, False])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_interpolated_values_are_weighted_by_the_barycentrics(backend, dtype):
    vertices, faces = soup(200, seed=6, dtype=dtype)
    hits = wive.Scene(vertices, faces, backend=backend).intersect(*random_rays(200, seed=7, dtype=dtype))
    values = np.random.default_rng(1).standard_normal((len(vertices), 4))
    found = hits.interpolate(values)
    assert found.shape == (200, 4)
    for i in range(200):
        if not hits.mask[i]:
            assert np.isnan(found[i]).all()
            continue
        u, v = hits.uv[i].astype(np.float64)
        np.testing.assert_allclose(found[i], [1 - u - v, u, v] @ values[faces[hits.prim[i]]], atol=1e-14)
    np.testing.assert_array_equal(hits.interpolate(values[:, 1]), found[:, 1])
    np.testing.assert_array_equal(hits.interpolate(values[:, :1]), found[:, :1])
    np.testing.assert_array_equal(hits.interpolate(vertices.astype(np.float64)), hits.points())
    assert hits.interpolate(values[:, :0]).shape == (200, 0)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        *((kind, np.float32) for kind in (np.float16, np.float32, ">f4")),
        *((kind, np.float64) for kind in (np.float64, ">f8", np.uint8, np.int64, np.longdouble)),
    ],
)
def test_interpolated_values_are_float32_for_short_floats_else_float64(given, expected):
    vertices, faces = sphere(1)
    hits = wive.Scene(vertices, faces).intersect([0, 0, 5], [0, 0, -1])
    values = np.arange(len(vertices)) % 2
    found = hits.interpolate(values.astype(given))
    assert found.dtype == expected
    np.testing.assert_allclose(found, hits.interpolate(values.astype(np.float64)), rtol=1e-6)
    np.testing.assert_allclose(hits.interpolate(values.tolist()), found, rtol=1e-6)


def test_masked_vertex_values_count_as_nan():
    scene = wive.Scene([[-1, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 9]], [[0, 1, 2]])
    hits = scene.intersect([0, 0, 1], [0, 0, -1])
    values = np.ma.MaskedArray([1.0, 1, 1, 1], [False, False, False, True])
    assert hits.interpolate(values) == 1
    values[2] = np.ma.masked
    assert np.isnan(hits.interpolate(values)).all()


def test_hits_of_pictures_have_values_in_their_shape(backend):
    scene = wive.Scene(*sphere(2), backend=backend)
    rays = wive.Camera((0, 0, 4), (0, 0, 0)).rays(8, 6, np.float32)
    hits, flat = scene.intersect(*rays), scene.intersect(*(array.reshape(-1, 3) for array in rays))
    colours = np.random.default_rng(1).random((len(scene.vertices), 3))
    for found, expected in (
        (hits.front, flat.front),
        (hits.cosines(), flat.cosines()),
        (hits.interpolate(colours), flat.interpolate(colours)),
        (hits.interpolate(colours[:, 0]), flat.interpolate(colours[:, 0])),
    ):
        assert found.shape[:2] == (6, 8)
        np.testing.assert_array_equal(found.reshape(expected.shape), expected)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("vectors", [True, False])
@pytest.mark.parametrize("shape", [(60,), (6, 10)])
def test_values_on_a_warp_device_are_those_of_the_cpu(dtype, vectors, shape):
    wp = pytest.importorskip("warp")
    vertices, faces = soup(200, seed=6, dtype=dtype)
    rays = [array.reshape(*shape, 3) for array in random_rays(60, seed=7, dtype=dtype)]
    expected = wive.Scene(vertices, faces).intersect(*rays)
    kind = {np.float32: wp.vec3, np.float64: wp.vec3d}[dtype]
    given = [wp.array(array, dtype=kind) if vectors else wp.array(array) for array in rays]
    colours = np.random.default_rng(1).random((len(vertices), 5)).astype(np.float32)
    for device in (None, "cpu"):
        hits = wive.Scene(vertices, faces, device=device).intersect(*given)
        np.testing.assert_array_equal(hits.front.numpy(), expected.front)
        np.testing.assert_array_equal(hits.cosines().numpy(), expected.cosines())
        for columns in (0, slice(1), slice(2), slice(3), slice(5)):
            values = np.ascontiguousarray(colours[:, columns])
            for source in (values, wp.array(values), Foreign.Array(values)):
                found = hits.interpolate(source)
                np.testing.assert_array_equal(found.numpy(), expected.interpolate(values))
        three = hits.interpolate(wp.array(colours[:, :3].copy(), dtype=wp.vec3))
        assert three.shape == (shape if vectors else (*shape, 3))
    with pytest.raises(TypeError, match=r"^vertex_values must be float32 or float64 on a Warp device"):
        hits.interpolate(wp.zeros(len(vertices), dtype=wp.int32))
    with pytest.raises(
        ValueError, match=r"^vertex_values must have shape \(600,\) or \(600, k\).* got \(5,\)"
    ):
        hits.interpolate(wp.zeros(5, dtype=wp.float32))


@pytest.mark.parametrize(
    ("values", "kind", "message"),
    [
        (np.zeros(11), ValueError, "vertex_values must have shape (12,) or (12, k), one row per vertex, got (11,)"),
        (np.zeros((3, 12)), ValueError, "vertex_values must have shape (12,) or (12, k), one row per vertex, got (3, 12)"),
        (np.zeros((12, 2, 2)), ValueError, "vertex_values must have shape (12,) or (12, k), one row per vertex, got (12, 2, 2)"),
        (1.0, ValueError, "vertex_values must have shape (12,) or (12, k), one row per vertex, got ()"),
        (["a"] * 12, TypeError, "vertex_values must be an array of real numbers, got dtype <U1: convert it first"),
        (np.zeros(12, complex), TypeError, "vertex_values must be an array of real numbers, got dtype complex128: convert it first"),
        (None, TypeError, "vertex_values must be an array of real numbers, got NoneType: convert it first"),
    ],
)  # fmt: skip
def test_vertex_values_of_no_sense_are_refused_in_one_line(values, kind, message):
    hits = wive.Scene(*sphere(0)).intersect([0, 0, 5], [0, 0, -1])
    with pytest.raises(kind) as error:
        hits.interpolate(values)
    assert str(error.value) == message


def test_hits_made_without_rays_have_values_but_no_sides():
    vertices, faces = sphere(0)
    hits = wive.Hits(np.zeros(3), np.int32([0, -1, 99]), np.full((3, 2), 0.25), vertices, faces)
    found = hits.interpolate(np.ones(12))
    np.testing.assert_array_equal(found, [1, np.nan, np.nan])
    for name in ("front", "cosines"):
        with pytest.raises(ValueError, match=f"^{name} needs hits that a scene returned"):
            getattr(hits, name)() if name == "cosines" else hits.front
