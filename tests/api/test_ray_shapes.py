"""Rays of any leading shape: answers have that shape, and each ray's is the one that it gets alone."""

import copy
import pickle

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import assert_same_hits, random_rays, sphere

import wive

SHAPES = [(6, 4), (2, 3, 4), (24, 1), (1, 24), (1, 1, 24)]
COUNT = 24


def rays(shape, dtype=np.float32):
    origins, directions = random_rays(COUNT, seed=3, dtype=dtype)
    return origins.reshape(*shape, 3), directions.reshape(*shape, 3)


def scene_of(dtype=np.float32, **options) -> wive.Scene:
    vertices, faces = sphere(2)
    return wive.Scene(vertices.astype(dtype), faces, **options)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", SHAPES)
def test_every_answer_is_that_of_its_ray_alone(backend, shape, dtype):
    scene = scene_of(dtype, backend=backend)
    origins, directions = rays(shape, dtype)
    tmin = np.linspace(0, 0.5, COUNT).reshape(shape).astype(dtype)
    tmax = np.linspace(3, 1, COUNT).reshape(shape).astype(dtype)
    limits = tmin, tmax
    hits, stats = scene.intersect(origins, directions, *limits, stats=True)
    blocked = scene.occluded(origins, directions, *limits)
    counts = scene.count(origins, directions, *limits)
    leaving = hits.spawn(-directions)
    of_hits = {name: getattr(hits, name) for name in ("t", "prim", "uv", "mask", "error_bound")}
    of_hits |= {"points": hits.points(), "normals": hits.normals()}
    assert 0 < np.count_nonzero(hits.mask) < COUNT
    assert len(hits) == COUNT
    for name, tail in {"uv": (2,), "points": (3,), "normals": (3,)}.items():
        assert of_hits[name].shape == (*shape, *tail)
    assert hits.t.shape == hits.prim.shape == blocked.shape == counts.shape == stats.leaves.shape == shape
    assert hits.t.dtype == hits.uv.dtype == leaving.dtype == dtype
    for place in np.ndindex(shape):
        ray = origins[place][None], directions[place][None], tmin[place], tmax[place]
        alone, steps = scene.intersect(*ray, stats=True)
        for name, values in of_hits.items():
            member = getattr(alone, name)
            expected = member() if callable(member) else member
            np.testing.assert_array_equal(values[place], expected[0], err_msg=name)
        np.testing.assert_array_equal(leaving[place], alone.spawn(-directions[place])[0])
        assert blocked[place] == scene.occluded(*ray)[0]
        assert counts[place] == scene.count(*ray)[0]
        assert [column[place] for column in stats] == [column[0] for column in steps]


def test_rays_of_a_picture_may_share_an_origin_a_direction_and_a_limit(backend):
    scene = scene_of(backend=backend)
    origins, directions = rays((6, 4))
    everywhere = np.broadcast_to(np.float32([0.1, 0.2, 3]), origins.shape)
    assert_same_hits(scene.intersect([0.1, 0.2, 3], directions), scene.intersect(everywhere, directions))
    down = np.broadcast_to(np.float32([0, 0, -1]), origins.shape)
    assert_same_hits(scene.intersect(origins, (0, 0, -1), 0, 9), scene.intersect(origins, down, 0.0, 9.0))
    shared = scene.intersect(origins, (0, 0, -1))
    np.testing.assert_array_equal(
        shared.spawn((0, 0, 1)), shared.spawn(np.broadcast_to([0, 0, 1], (6, 4, 3)))
    )


LAYOUTS = {
    "float64": lambda rays: rays.astype(np.float64),
    "big-endian": lambda rays: rays.astype(">f4"),
    "Fortran order": np.asfortranarray,
    "planes": lambda rays: np.moveaxis(np.ascontiguousarray(np.moveaxis(rays, -1, 0)), 0, -1),
    "every other": lambda rays: np.repeat(rays, 2, axis=0)[::2],
    "reversed": lambda rays: rays[::-1].copy()[::-1],
    "lists": np.ndarray.tolist,
    "tuple of arrays": tuple,
    "list of lists of rows": lambda rays: [list(row) for row in rays],
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_any_layout_gives_the_same_answers(layout):
    scene = scene_of()
    origins, directions = rays((6, 4))
    found = scene.intersect(layout(origins), layout(directions))
    assert found.t.shape == (6, 4)
    assert_same_hits(found, scene.intersect(origins, directions))


def test_pictures_of_the_scenes_dtype_are_not_copied():
    origins, directions = rays((6, 4))
    held = scene_of().intersect(origins, directions)._home._rays
    assert np.shares_memory(held.origins, origins)
    assert np.shares_memory(held.directions, directions)


@pytest.mark.parametrize("shape", [(0, 5), (5, 0), (0, 0, 2)])
def test_no_rays_of_any_shape(backend, shape):
    scene = scene_of(backend=backend)
    hits = scene.intersect(np.zeros((*shape, 3)), np.ones((*shape, 3)))
    assert hits.t.shape == hits.mask.shape == shape
    assert hits.uv.shape == (*shape, 2)
    assert hits.points().shape == hits.spawn((0, 0, 1)).shape == (*shape, 3)
    assert scene.occluded(np.zeros((*shape, 3)), (0, 0, 1)).shape == shape
    assert len(scene.intersect_all(np.zeros((*shape, 3)), (0, 0, 1))) == 0


def test_all_hits_number_the_rays_in_c_order(backend):
    scene = scene_of(backend=backend)
    origins, directions = rays((6, 4))
    every, stats = scene.intersect_all(origins, directions, stats=True)
    assert len(every) == COUNT
    assert stats.leaves.shape == (6, 4)
    counts = scene.count(origins, directions)
    for place in np.ndindex(6, 4):
        alone = scene.intersect_all(origins[place], directions[place])
        of_ray = every[np.ravel_multi_index(place, (6, 4))]
        np.testing.assert_array_equal(of_ray.t, alone.t)
        np.testing.assert_array_equal(of_ray.prim, alone.prim)
        assert counts[place] == len(alone.t)


def test_masked_rays_of_a_picture_miss():
    scene = scene_of()
    origins = np.ma.MaskedArray(np.zeros((2, 3, 3)), False)
    origins[1, 2, 0] = np.ma.masked
    expected = [[True] * 3, [True, True, False]]
    for given in (origins, list(origins)):
        np.testing.assert_array_equal(scene.intersect(given, (0, 0, 1)).mask, expected)
        np.testing.assert_array_equal(scene.occluded(given, (0, 0, 1)), expected)
    limits = np.ma.MaskedArray(np.full((2, 3), 9.0), np.logical_not(expected))
    np.testing.assert_array_equal(scene.occluded(np.zeros((2, 3, 3)), (0, 0, 1), 0, limits), expected)


def test_rays_from_far_away_are_brought_near_in_any_shape():
    scene = scene_of()
    origins, directions = rays((6, 4), np.float64)
    origins = origins / 2 - 1e7 * directions
    found = scene.intersect(origins, directions)
    flat = scene.intersect(origins.reshape(-1, 3), directions.reshape(-1, 3))
    assert found.mask.any()
    np.testing.assert_array_equal(found.t, flat.t.reshape(6, 4))
    np.testing.assert_array_equal(found.error_bound, flat.error_bound.reshape(6, 4))


def libraries() -> dict[str, tuple]:
    """Ways to make arrays of other libraries, and to read them."""
    found = {"DLPack": (Foreign.Array, lambda array: array.values)}
    for name in ("torch", "jax"):
        try:
            module = __import__(name)
        except ImportError:
            continue
        make = module.from_numpy if name == "torch" else module.numpy.asarray
        found[name] = make, np.asarray
    return found


@pytest.mark.parametrize(("make", "read"), libraries().values(), ids=libraries())
def test_arrays_of_other_libraries_give_theirs_in_the_same_shape(make, read):
    scene = scene_of()
    origins, directions = rays((2, 3, 4))
    expected = scene.intersect(origins, directions, 0.0, np.full((2, 3, 4), 2, np.float32))
    limits = 0.0, make(np.full((2, 3, 4), 2, np.float32))
    found = scene.intersect(make(origins), make(directions), *limits)
    for name in ("t", "prim", "uv", "mask", "error_bound"):
        values = getattr(found, name)
        assert type(values) is type(make(origins))
        np.testing.assert_allclose(read(values), getattr(expected, name), rtol=1e-7)  # JAX rounds float64
    np.testing.assert_allclose(read(found.points()), expected.points(), rtol=1e-6)
    np.testing.assert_array_equal(read(found.spawn(make(-directions))), expected.spawn(-directions))
    np.testing.assert_array_equal(
        read(scene.occluded(make(origins), (0, 0, 1))), scene.occluded(origins, (0, 0, 1))
    )
    assert len(scene.intersect_all(make(origins), make(directions))) == COUNT


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("vectors", [True, False])
@pytest.mark.parametrize("on_device", [True, False])
def test_warp_arrays_of_any_shape(dtype, vectors, on_device):
    wp = pytest.importorskip("warp")
    scene = scene_of(dtype, device="cpu" if on_device else None)
    origins, directions = rays((6, 4), dtype)
    kind = {np.float32: wp.vec3, np.float64: wp.vec3d}[dtype]
    expected = scene_of(dtype).intersect(origins, directions, 0.0, np.full((6, 4), 2, dtype))

    def make(array):
        return wp.array(array, dtype=kind, device="cpu") if vectors else wp.array(array, device="cpu")

    found = scene.intersect(make(origins), make(directions), 0.0, wp.array(np.full((6, 4), 2, dtype)))
    for name in ("t", "prim", "uv", "mask", "error_bound"):
        np.testing.assert_array_equal(getattr(found, name).numpy(), getattr(expected, name))
    assert found.t.shape == (6, 4)
    assert found.uv.shape == ((6, 4) if vectors else (6, 4, 2))
    np.testing.assert_array_equal(found.points().numpy(), expected.points())
    np.testing.assert_array_equal(found.spawn(make(-directions)).numpy(), expected.spawn(-directions))
    across = make(np.ascontiguousarray(origins.swapaxes(0, 1))).transpose((1, 0) if vectors else (1, 0, 2))
    np.testing.assert_array_equal(
        scene.occluded(across, (0, 0, 1)).numpy(), scene.occluded(make(origins), (0, 0, 1)).numpy()
    )
    assert scene.count(make(origins), (0, 0, 1), stats=True)[1].leaves.shape == (6, 4)
    assert len(scene.intersect_all(make(origins), make(directions))) == COUNT


def test_hits_of_a_picture_can_be_pickled_and_copied_and_show_their_shape():
    hits = scene_of().intersect(*rays((6, 4)))
    assert repr(hits) == f"Hits((6, 4) rays, {np.count_nonzero(hits.mask)} hit)"
    for again in (pickle.loads(pickle.dumps(hits)), copy.copy(hits), copy.deepcopy(hits)):
        assert repr(again) == repr(hits)
        assert_same_hits(again, hits)
        np.testing.assert_array_equal(again.error_bound, hits.error_bound)
    assert len(pickle.dumps(hits)) < 1.1 * len(pickle.dumps(hits._home))
    with pytest.raises(AttributeError, match="read-only"):
        hits.t = hits.t


PICTURE = np.zeros((4, 5, 3))
NO_VECTORS = "{} must have shape (..., 3), one vector per ray, got {}"
NOT_ONE_SHAPE = (
    "origins and directions must have one shape, or one of them (3,) if all rays share it, got {} and {}"
)
NOT_PER_RAY = "{} must be one number or have shape {}, one per ray, got shape {}"
RAGGED = [[[0, 0, 1]], [[0, 0, 1], [1, 0, 0]]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((4, 5, 2)), (0, 0, 1)), NO_VECTORS.format("origins", (4, 5, 2))),
        (((0, 0, 1), np.zeros((3, 4, 5))), NO_VECTORS.format("directions", (3, 4, 5))),
        ((PICTURE, 1.0), NO_VECTORS.format("directions", ())),
        ((PICTURE, PICTURE[0]), NOT_ONE_SHAPE.format((4, 5, 3), (5, 3))),
        ((PICTURE[:1], PICTURE), NOT_ONE_SHAPE.format((1, 5, 3), (4, 5, 3))),
        ((PICTURE, np.zeros((5, 4, 3))), NOT_ONE_SHAPE.format((4, 5, 3), (5, 4, 3))),
        ((PICTURE, PICTURE, np.zeros(20)), NOT_PER_RAY.format("tmin", (4, 5), (20,))),
        ((PICTURE, PICTURE, 0, np.zeros((5, 4))), NOT_PER_RAY.format("tmax", (4, 5), (5, 4))),
        ((PICTURE, PICTURE, 0, np.zeros((4, 5, 1))), NOT_PER_RAY.format("tmax", (4, 5), (4, 5, 1))),
        ((PICTURE[0], PICTURE[0], np.zeros((2, 2))), NOT_PER_RAY.format("tmin", (5,), (2, 2))),
        ((RAGGED, (0, 0, 1)), "origins must be an array of real numbers, got rows of unequal length"),
    ],
)
@pytest.mark.parametrize("query", ["intersect", "occluded", "count", "intersect_all"])
def test_shapes_that_do_not_fit_are_refused_in_one_line(query, arguments, message):
    with pytest.raises(ValueError) as error:
        getattr(scene_of(), query)(*arguments)
    assert str(error.value) == message


def test_numbers_that_are_none_are_refused():
    with pytest.raises(TypeError, match=r"^origins must be .*, got dtype <U1"):
        scene_of().intersect([[["a", "b", "c"]]], (0, 0, 1))
    with pytest.raises(TypeError, match=r"^tmax must be an array of real numbers, got NoneType"):
        scene_of().occluded(PICTURE, (0, 0, 1), 0, None)


@pytest.mark.parametrize("shape", [(20, 3), (5, 4, 3), (4, 5), (4, 1, 3)])
def test_spawned_directions_have_the_shape_of_the_hits(shape):
    hits = scene_of().intersect(PICTURE, (0, 0, 1))
    with pytest.raises(ValueError) as error:
        hits.spawn(np.ones(shape))
    assert str(error.value) == f"directions must have shape (4, 5, 3), one per hit, or (3,), got {shape}"


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lines_of_sight_have_the_shape_of_their_ends(backend, dtype):
    scene = scene_of(dtype, backend=backend)
    a, b = rays((6, 4), dtype)
    found = scene.visible(a, b)
    assert found.shape == (6, 4)
    assert 0 < np.count_nonzero(found) < COUNT
    np.testing.assert_array_equal(found.ravel(), scene.visible(a.reshape(-1, 3), b.reshape(-1, 3)))
    np.testing.assert_array_equal(scene.visible(a[0, 0], b).ravel(), scene.visible(a[0, 0], b.reshape(-1, 3)))
    np.testing.assert_array_equal(scene.visible(a.tolist(), np.asfortranarray(b)), found)
    np.testing.assert_array_equal(scene.visible(Foreign.Array(a), Foreign.Array(b)).values, found)
    picture = scene.intersect(*wive.Camera((0, 0, 4), (0, 0, 0)).rays(8, 6, dtype))
    np.testing.assert_array_equal(scene.visible((0, 0, 4), picture.points()), picture.mask)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_places_to_spawn_from_have_any_shape(dtype):
    scene = scene_of(dtype)
    prim = np.arange(COUNT, dtype=np.int32)
    uv = np.random.default_rng(1).uniform(0, 0.5, (COUNT, 2)).astype(dtype)
    directions = rays((COUNT,), dtype)[1]
    expected = scene.spawn(prim, uv, directions).reshape(6, 4, 3)
    shaped = prim.reshape(6, 4), uv.reshape(6, 4, 2), directions.reshape(6, 4, 3)
    np.testing.assert_array_equal(scene.spawn(*shaped), expected)
    np.testing.assert_array_equal(scene.spawn(*(array.tolist() for array in shaped)), expected)
    np.testing.assert_array_equal(scene.spawn(*map(Foreign.Array, shaped)).values, expected)
    one = scene.spawn(shaped[0], (0.25, 0.25), (0, 0, 1))
    np.testing.assert_array_equal(one, scene.spawn(prim, (0.25, 0.25), (0, 0, 1)).reshape(6, 4, 3))


def test_ends_and_places_whose_shapes_do_not_fit_are_refused():
    scene = scene_of()
    with pytest.raises(ValueError, match=r"^a and b must have one shape, or one of them \(3,\) if"):
        scene.visible(PICTURE, PICTURE[0])
    with pytest.raises(ValueError, match=r"^b must have shape \(\.\.\., 3\), one vector per segment, got"):
        scene.visible(PICTURE, np.zeros((4, 5)))
    with pytest.raises(ValueError, match=r"^uv must have shape \(4, 5, 2\), one row per prim, or"):
        scene.spawn(np.zeros((4, 5), int), np.zeros((20, 2)), PICTURE)
    with pytest.raises(ValueError, match=r"^directions must have shape \(4, 5, 3\), one row per prim, or"):
        scene.spawn(np.zeros((4, 5), int), (0.2, 0.2), PICTURE[0])
