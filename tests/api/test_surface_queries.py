"""`Scene.spawn` and `Scene.visible`: shapes, dtypes, arrays of other libraries, and errors."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import TRIANGLE, soup, sphere

import wive

SCENES = [("fast", np.float32), ("watertight", np.float32), ("exact", np.float32),
          ("fast", np.float64), ("watertight", np.float64)]  # fmt: skip


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES)
def test_origins_from_places_are_those_of_hits_there(accuracy: str, dtype: type, backend: str) -> None:
    vertices, faces = sphere(3)
    scene = wive.Scene(vertices.astype(dtype), faces, accuracy=accuracy, backend=backend)
    random = np.random.default_rng(1)
    origins, directions, onwards = random.standard_normal((3, 5000, 3)).astype(dtype)
    hits = scene.intersect(origins, directions)
    assert 0.05 < hits.mask.mean() < 0.95
    found = scene.spawn(hits.prim, hits.uv, onwards)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, hits.spawn(onwards))
    assert (np.isnan(found).all(axis=1) == ~hits.mask).all()


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES)
@pytest.mark.parametrize("uv", [(1 / 3, 1 / 3), (0, 0), (1, 0), (0.5, 0.5), (0.25, 0)])
def test_rays_from_every_triangle_outwards_leave_and_inwards_cross(
    uv: tuple[float, float], accuracy: str, dtype: type
) -> None:
    """Centres, corners, and places on edges of a convex body, whose thickness is found that way."""
    vertices, faces = sphere(3, 10.0)
    scene = wive.Scene(vertices.astype(dtype), faces, accuracy=accuracy)
    corners = scene.vertices[scene.faces].astype(np.float64)
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    every = range(len(scene))
    assert not scene.occluded(scene.spawn(every, uv, outwards), outwards).any()
    thickness = scene.intersect(
        scene.spawn(every, uv, -outwards), -outwards / np.linalg.norm(outwards, axis=1)[:, None]
    )
    own = thickness.prim == np.arange(len(scene))
    assert not own.any()
    if uv == (1 / 3, 1 / 3):
        assert (abs(thickness.t - 20) < 0.1).all()


def test_no_triangle_and_triangles_without_area_give_origins_that_miss() -> None:
    scene = wive.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1], [2, 0, 1]], [[0, 1, 2], [0, 1, 3]])
    origins = scene.spawn([0, -1, 1, 0], [[0.2, 0.2]] * 3 + [[np.nan, 0.2]], [0, 0, -1])
    assert np.isnan(origins).any(axis=1).tolist() == [False, True, True, True]
    assert not scene.occluded(origins[1:], [0, 0, 1]).any()
    assert scene.spawn([], np.zeros((0, 2)), [0, 0, 1]).shape == (0, 3)
    assert scene.spawn([], [], []).shape == (0, 3)


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int64, np.uint64, ">i4"])
def test_prim_of_any_integers(dtype: str | type) -> None:
    scene = wive.Scene(*TRIANGLE)
    expected = scene.spawn([0, 0], [[0.1, 0.2], [0.3, 0.4]], [[0, 0, 1], [0, 0, -1]])
    found = scene.spawn(
        np.zeros(4, dtype)[::2],
        np.asfortranarray([[0.1, 0.2], [0.3, 0.4]]),
        np.array([[0, 0, 1], [0, 0, -1]], np.int16),
    )
    np.testing.assert_array_equal(found, expected)


BAD_PLACES = [
    ([0, 1], [0, 0], [0, 0, 1], "prim must be rows of the 1 faces from 0, or -1 for none, got prim[1] = 1"),
    ([-2], [0, 0], [0, 0, 1], "prim must be rows of the 1 faces from 0, or -1 for none, got prim[0] = -2"),
    (np.array([2**40]), [0, 0], [0, 0, 1], "got prim[0] = 1099511627776"),
    (0, [0, 0], [0, 0, 1], "prim must have shape (n,), one triangle per ray, got ()"),
    ([0.0], [0, 0], [0, 0, 1], "prim must be an (n,) array of integers, got dtype float64"),
    ([True], [0, 0], [0, 0, 1], "prim must be an (n,) array of integers, got dtype bool"),
    (np.ma.masked_array([0], [True]), [0, 0], [0, 0, 1], "array of integers, got 1 that are masked"),
    ([0], [0, 0, 0], [0, 0, 1], "uv must have shape (n, 2), or (2,) if all rays share it, got (3,)"),
    ([0], [[0, 0]] * 2, [0, 0, 1], "uv must have shape (1, 2), one per hit, or (2,), got (2, 2)"),
    ([0], "uv", [0, 0, 1], "uv must be an (n, 2) array of real numbers, got dtype <U2"),
    ([0], [0, 0], [[0, 0, 1]] * 3, "directions must have shape (1, 3), one per hit, or (3,), got (3, 3)"),
    ([0], [0, 0], [0, 1], "directions must have shape (n, 3), or (3,) if all rays share it, got (2,)"),
]  # fmt: skip


@pytest.mark.parametrize(("prim", "uv", "directions", "text"), BAD_PLACES)
def test_places_that_are_none_are_named(prim: object, uv: object, directions: object, text: str) -> None:
    with pytest.raises((TypeError, ValueError), match=re.escape(text)) as caught:
        wive.Scene(*TRIANGLE).spawn(prim, uv, directions)
    assert "\n" not in str(caught.value)


BAD_ENDS = [
    (np.zeros((2, 3)), np.zeros((3, 3)), "a and b must be equally many, or one of them (3,), got 2 and 3"),
    (np.zeros((2, 2)), np.zeros((2, 3)), "a must have shape (n, 3), or (3,) if all rays share it, got (2,"),
    (np.zeros((2, 3)), 5.0, "b must have shape (n, 3), or (3,) if all rays share it, got ()"),
    (np.zeros((2, 3)), [["x"] * 3], "b must be an (n, 3) array of real numbers, got dtype <U1"),
    (np.zeros((2, 3), complex), [0, 0, 1], "a must be an (n, 3) array of real numbers, got dtype complex128"),
    ([[0, 0, 0], [0, 0]], [0, 0, 1], "a must be an (n, 3) array of real numbers, got rows of unequal length"),
]  # fmt: skip


@pytest.mark.parametrize(("a", "b", "text"), BAD_ENDS)
def test_ends_that_are_none_are_named(a: object, b: object, text: str) -> None:
    with pytest.raises((TypeError, ValueError), match=re.escape(text)) as caught:
        wive.Scene(*TRIANGLE).visible(a, b)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_one_point_may_be_seen_by_all(dtype: type) -> None:
    vertices, faces = soup(300, seed=2, dtype=dtype)
    scene = wive.Scene(vertices, faces)
    points = np.random.default_rng(3).random((500, 3)).astype(dtype)
    expected = scene.visible(points, np.repeat(points[:1], 500, axis=0))
    assert expected.dtype == np.bool_ and expected.shape == (500,) and 0 < expected.sum() < 500
    for one in (points[0], points[:1], points[0].tolist()):
        np.testing.assert_array_equal(scene.visible(points, one), expected)
        np.testing.assert_array_equal(scene.visible(one, points), expected)
    assert scene.visible(points[0], points[1]).shape == (1,)
    assert scene.visible(points[:0], points[0]).shape == scene.visible(points[:0], points[:0]).shape == (0,)


def test_ends_of_any_dtype_and_layout() -> None:
    vertices, faces = soup(300, seed=4)
    scene = wive.Scene(vertices, faces)
    a, b = np.random.default_rng(5).integers(0, 2, (2, 200, 3))
    expected = scene.visible(a.astype(np.float32), b.astype(np.float32))
    for dtype in (np.int8, np.uint64, np.float16, ">f4", np.float64, np.longdouble):
        np.testing.assert_array_equal(
            scene.visible(a.astype(dtype), np.asfortranarray(b.astype(dtype))), expected
        )
    np.testing.assert_array_equal(scene.visible(a.tolist(), b.repeat(2, axis=0)[::2]), expected)


def test_points_in_half_precision_are_not_hidden_by_what_they_lie_on() -> None:
    vertices, faces = sphere(1)
    scene = wive.Scene(vertices, faces)
    points = vertices[faces].mean(axis=1).astype(np.float16)
    assert scene.visible(points, 5 * points).all()
    assert not scene.visible(points.astype(np.float32), 5 * points).all()


def test_more_segments_than_one_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, faces = soup(300, seed=6)
    scene = wive.Scene(vertices, faces)
    a, b = np.random.default_rng(7).random((2, 1000, 3))
    whole = scene.visible(a, b)
    monkeypatch.setattr("wive._internal.segments.CHUNK", 333)
    np.testing.assert_array_equal(scene.visible(a, b), whole)
    np.testing.assert_array_equal(scene.visible(a, b[0]), scene.visible(a, np.repeat(b[:1], 1000, axis=0)))


def test_answers_follow_a_refit() -> None:
    scene = wive.Scene(*TRIANGLE)
    assert not scene.visible([0.2, 0.2, 0], [0.2, 0.2, 2]).any()
    scene.refit(TRIANGLE[0] + np.float32([5, 0, 0]))
    assert scene.visible([0.2, 0.2, 0], [0.2, 0.2, 2]).all()
    assert scene.spawn([0], [0.2, 0.2], [0, 0, 1])[0, 0] == pytest.approx(5.2)


def foreign_of(values: object) -> Foreign.Array:
    return Foreign.Array(values)


def warp_of(values: object) -> object:
    wp = pytest.importorskip("warp")
    array = np.ascontiguousarray(values)
    vectors = {(2,): wp.vec2, (3,): wp.vec3}.get(array.shape[1:])
    return wp.array(array, dtype=vectors, device="cpu") if vectors else wp.array(array, device="cpu")


def torch_of(values: object) -> object:
    return pytest.importorskip("torch").from_numpy(np.ascontiguousarray(values))


@pytest.mark.parametrize("make", [foreign_of, warp_of, torch_of])
def test_arrays_of_other_libraries_give_their_arrays(make: Callable[[object], object], backend: str) -> None:
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces, backend=backend)
    random = np.random.default_rng(8)
    prim, uv = np.arange(100, dtype=np.int32), random.random((100, 2)).astype(np.float32) / 2
    directions = random.standard_normal((100, 3)).astype(np.float32)

    def same(found: object, expected: np.ndarray) -> None:
        assert type(found) is type(make(expected))
        values = found.values if isinstance(found, Foreign.Array) else found.numpy()
        np.testing.assert_array_equal(values, expected)

    same(scene.spawn(make(prim), make(uv), make(directions)), scene.spawn(prim, uv, directions))
    same(scene.spawn(make(prim), uv, (0, 0, 1)), scene.spawn(prim, uv, (0, 0, 1)))
    same(scene.visible(make(directions), make(directions[::-1])), scene.visible(directions, directions[::-1]))
    same(scene.visible([5, 5, 5], make(directions)), scene.visible([5, 5, 5], directions))


def test_arrays_on_devices_are_refused_by_name() -> None:
    scene = wive.Scene(*TRIANGLE)
    far = Foreign.Array(np.zeros((1, 3), np.float32), place=(2, 0))
    text = "must be in host memory, where {} computes, got an array on cuda:0: copy it to the host"
    with pytest.raises(ValueError, match="^b " + text.format("visible")):
        scene.visible([0, 0, 0], far)
    with pytest.raises(ValueError, match="^directions " + text.format("spawn")):
        scene.spawn([0], [0, 0], far)


def test_threads_are_for_cpu_backends(backend: str) -> None:
    scene = wive.Scene(*TRIANGLE, backend=backend)
    if backend == "warp":
        with pytest.raises(ValueError, match="threads is only for CPU backends"):
            scene.visible([0, 0, 0], [0, 0, 2], threads=1)
    else:
        assert not scene.visible([0, 0, 0], [0, 0, 2], threads=1).any()
        with pytest.raises(ValueError, match="threads must be from 1"):
            scene.visible([0, 0, 0], [0, 0, 2], threads=0)
