"""`Scene.closest`: shapes, libraries, and what is refused."""

import copy
import pickle

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import sphere

import wive

COUNT = 24
SHAPES = [(6, 4), (2, 3, 4), (1, 24), (1, 1, 24)]


def scene_of(dtype=np.float32, **options) -> wive.Scene:
    vertices, faces = sphere(2)
    return wive.Scene(vertices.astype(dtype), faces, **options)


def points_of(dtype=np.float32) -> np.ndarray:
    return np.random.default_rng(4).uniform(-2, 2, (COUNT, 3)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", SHAPES)
def test_answers_have_the_points_leading_shape(backend, shape, dtype):
    scene, points = scene_of(dtype, backend=backend), points_of(dtype)
    most = np.linspace(0, 1, COUNT).astype(dtype)
    flat = scene.closest(points, most)
    assert 0 < np.count_nonzero(flat.mask) < COUNT
    shaped = scene.closest(points.reshape(*shape, 3), most.reshape(shape))
    assert len(shaped) == shape[0]
    for name, tail in {
        "distance": (),
        "prim": (),
        "uv": (2,),
        "mask": (),
        "geom": (),
        "geom_prim": (),
    }.items():
        values = getattr(shaped, name)
        assert values.shape == (*shape, *tail)
        np.testing.assert_array_equal(values.reshape(-1, *tail), getattr(flat, name))
    for name in ("points", "normals"):
        values = getattr(shaped, name)()
        assert values.shape == (*shape, 3) and values.dtype == np.float64
        np.testing.assert_array_equal(values.reshape(-1, 3), getattr(flat, name)())
    heights = scene.vertices[:, 2]
    np.testing.assert_array_equal(shaped.interpolate(heights).ravel(), flat.interpolate(heights))
    assert flat.distance.dtype == flat.uv.dtype == dtype and flat.prim.dtype == np.int32


def test_one_point_is_a_batch_of_one(backend):
    found = scene_of(backend=backend).closest([0, 0, 3])
    assert found.distance.shape == (1,) and found.points().shape == (1, 3)
    np.testing.assert_array_equal(found.points(), [[0, 0, 1]])


def test_a_closest_point_lies_where_its_distance_says(backend):
    points = points_of()
    found = scene_of(backend=backend).closest(points)
    np.testing.assert_allclose(
        np.linalg.norm(found.points() - points, axis=1), found.distance, rtol=1e-6, atol=1e-6
    )
    outside = np.linalg.norm(points, axis=1) > 1.1
    assert ((found.normals() * (points - found.points())).sum(axis=1)[outside] > 0).all()


def test_results_are_copied_and_pickled_whole_and_never_set(cpu_backend):
    scene = scene_of(backend=cpu_backend)
    for points in (points_of(), points_of().reshape(6, 4, 3)):
        found = scene.closest(points)
        for other in (pickle.loads(pickle.dumps(found)), copy.deepcopy(found)):
            np.testing.assert_array_equal(other.distance, found.distance)
            np.testing.assert_array_equal(other.points(), found.points())
    with pytest.raises(AttributeError, match=r"Closest\.distance can't be set"):
        scene.closest(points_of()).distance = 0


def test_what_it_shows_says_how_many_and_where():
    scene = scene_of()
    assert repr(scene.closest(points_of(), 0.3)).startswith("Closest(24 points, ")
    assert repr(scene.closest(points_of().reshape(6, 4, 3))) == "Closest((6, 4) points, in arrays of numpy)"


def test_arrays_of_another_library_come_back_as_that(cpu_backend):
    scene, points = scene_of(backend=cpu_backend), points_of()
    flat = scene.closest(points)
    foreign = scene.closest(Foreign.Array(points))
    assert isinstance(foreign.distance, Foreign.Array)
    np.testing.assert_array_equal(foreign.distance.values, flat.distance)
    np.testing.assert_array_equal(foreign.points().values, flat.points())


def test_vectors_of_warp_come_back_as_vectors(device):
    wp = pytest.importorskip("warp")
    scene = scene_of()
    found = scene.closest(wp.array(points_of(), dtype=wp.vec3, device="cpu"))
    assert found.uv.dtype == wp.vec2 and found.points().dtype == wp.vec3d
    np.testing.assert_array_equal(found.distance.numpy(), scene.closest(points_of()).distance)


def test_several_meshes_are_told_apart(backend):
    vertices, faces = sphere(2)
    scene = wive.Scene.from_meshes(
        [(vertices, faces), (vertices + np.float32([5, 0, 0]), faces)], backend=backend
    )
    found = scene.closest([[-2, 0, 0], [7, 0, 0], [np.nan, 0, 0]])
    assert found.geom.tolist() == [0, 1, -1]
    assert found.geom_prim[1] == found.prim[1] - len(faces)


def test_numbers_that_are_masked_are_close_to_nothing(backend):
    points = np.ma.masked_array(points_of(), mask=False)
    points[3, 1] = np.ma.masked
    found = scene_of(backend=backend).closest(points)
    assert np.flatnonzero(found.prim < 0).tolist() == [3]


def test_points_are_not_copied_if_they_need_not_be(cpu_backend):
    points = points_of()
    points.flags.writeable = False
    scene_of(backend=cpu_backend).closest(points)
    strided = np.zeros((COUNT, 6), np.float32)
    strided[:, ::2] = points
    for same in (np.asfortranarray(points), strided[:, ::2], points.astype(np.float64), points.tolist()):
        np.testing.assert_array_equal(
            scene_of(backend=cpu_backend).closest(same).distance,
            scene_of(backend=cpu_backend).closest(points).distance,
        )


REFUSED = {
    "flat": ((np.zeros(4),), "points must have shape (..., 3), one point per row, got (4,)"),
    "columns": ((np.zeros((2, 4)),), "points must have shape (..., 3), one point per row, got (2, 4)"),
    "number": ((3.0,), "points must have shape (..., 3), one point per row, got ()"),
    "text": (("abc",), "points must be an array of real numbers, got dtype <U3"),
    "complex": (
        (np.zeros((2, 3), complex),),
        "points must be an (n, 3) array of real numbers, got dtype complex128",
    ),
    "ragged": (([[1, 2, 3], [1, 2]],), "points must be an array of real numbers, got rows of unequal length"),
    "negative": ((np.zeros((2, 3)), -1), "max_distance must be 0 or more, np.inf for no limit, got -1.0"),
    "NaN": ((np.zeros((2, 3)), np.nan), "max_distance must be 0 or more, np.inf for no limit, got nan"),
    "one negative": (
        (np.zeros((2, 3)), [1, -2]),
        "max_distance must be 0 or more, np.inf for no limit, got max_distance[1] = -2.0",
    ),
    "too many": (
        (np.zeros((2, 3)), np.ones(3)),
        "max_distance must be one number or have shape (2,), one per point, got shape (3,)",
    ),
    "other shape": (
        (np.zeros((2, 2, 3)), np.ones(4)),
        "max_distance must be one number or have shape (2, 2), one per point, got shape (4,)",
    ),
    "none": ((np.zeros((2, 3)), None), "max_distance must be a real number or one per point, got NoneType"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_point_or_distance_is_refused_in_one_line(backend, name):
    given, expected = REFUSED[name]
    with pytest.raises((ValueError, TypeError)) as caught:
        scene_of(backend=backend).closest(*given)
    text = str(caught.value)
    assert text.startswith(expected) and "\n" not in text, text


def test_threads_are_for_cpu_backends(backend):
    scene = scene_of(backend=backend)
    if backend == "warp":
        with pytest.raises(ValueError, match="threads is only for CPU backends"):
            scene.closest(points_of(), threads=2)
    else:
        with pytest.raises(ValueError, match="threads must be from 1"):
            scene.closest(points_of(), threads=0)
