"""Numbers are kept or refused: precision, rounding, masks, and vertices that no face uses."""

import pickle

import numpy as np
import pytest
from support.meshes import TRIANGLE, assert_same_hits, random_rays, sphere

import wive

VERTICES, FACES = TRIANGLE
RAY = [[0.25, 0.25, -1.0]], [[0.0, 0, 1]]
NAN, INF = np.nan, np.inf


class Table:
    """A table as pandas has them: columns of their own dtypes, and arrays when NumPy asks."""

    def __init__(self, *columns):
        self.columns = columns

    def __array__(self, dtype=None, copy=None):
        return np.stack([np.asarray(column, dtype) for column in self.columns], axis=1)


# Name, the numbers as a user has them, and whether float32 holds all of them.
NUMBERS = {
    "int64 above 2**24": (np.array([[2**24 + 1, 0, 0], [2**24 + 3, 0, 0], [2**24, 9, 0]]), False),
    "int64 above 2**53": (np.array([[2**53 + 1, 0, 0], [0, 1, 0], [0, 0, 1]]), False),
    "the largest int64": (np.array([[2**63 - 1, 0, 0], [0, 1, 0], [0, 0, 1]]), False),
    "the largest uint64": (np.array([[2**64 - 1, 0, 0], [0, 1, 0], [0, 0, 1]], np.uint64), False),
    "float64": (np.array([[0, 0, 0.1], [1, 0, 0], [0, 1, 0]]), False),
    "big-endian float64": (np.array([[0, 0, 0.1], [1, 0, 0], [0, 1, 0]], ">f8"), False),
    "longdouble": (np.eye(3, dtype=np.longdouble) * (1 + np.finfo(np.longdouble).eps), False),
    "beyond float32": (np.array([[0, 0, 1e300], [1, 0, 0], [0, 1, 0]]), False),
    "below float32": (np.array([[0, 0, 1e-300], [1, 0, 0], [0, 1, 0]]), False),
    "a list": ([[0, 0, 0.1], [1, 0, 0], [0, 1, 0]], False),
    "a list of integers": ([[2**24 + 1, 0, 0], [0, 1, 0], [0, 0, 1]], False),
    "a list in which NumPy rounds": ([[2**53 + 1, 0.5, 0], [0, 1, 0], [0, 0, 1]], False),
    "a tuple": (((0, 0, 0.1), (1, 0, 0), (0, 1, 0)), False),
    "a table": (Table([0, 0, 1], [0.1, 0, 0], [0, 1, 0]), False),
    "a table in which NumPy rounds": (Table(np.array([2**53 + 1, 0, 1]), [0.5, 0, 0], [0, 1, 0]), False),
    "small integers": (np.array([[2**24, 0, 0], [-3, 1, 0], [0, 0, 1]]), True),
    "a power of two": (np.array([[2**59, 0, 0], [0, 1, 0], [0, 0, 1]]), True),
    "float16": (np.array([[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]], np.float16), True),
    "float64 from float32": (np.float32([[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]]).astype(np.float64), True),
    "a list of halves": ([[0.5, 0, 0], [0, 1, 0], [0, 0, 1.5]], True),
}


@pytest.mark.parametrize(("numbers", "fits"), NUMBERS.values(), ids=NUMBERS.keys())
def test_exact_takes_what_float32_holds_and_refuses_what_it_would_round(numbers, fits):
    scene = wive.Scene(VERTICES, FACES, accuracy="exact")
    for call in (lambda: wive.Scene(numbers, FACES, accuracy="exact"), lambda: scene.refit(numbers)):
        if fits:
            call()
            continue
        with pytest.raises(ValueError) as error:
            call()
        text = str(error.value)
        assert text.startswith("vertices must be float32 numbers for accuracy 'exact', got vertices[0] = ")
        assert "np.float32" in text
        assert "\n" not in text


@pytest.mark.parametrize("numbers", [numbers for numbers, _ in NUMBERS.values()], ids=NUMBERS.keys())
def test_exact_rounds_rays_once(numbers):
    scene = wive.Scene(VERTICES, FACES, accuracy="exact")
    with np.errstate(over="ignore"):
        rounded = np.asarray(numbers, np.float32)
    near = np.float32([0, 0.1, -1])
    pairs = ((numbers, near.tolist()), (rounded, near)), ((VERTICES, numbers), (VERTICES, rounded))
    for given, taken in pairs:
        hits, same = scene.intersect(*given, 0.1), scene.intersect(*taken, np.float32(0.1))
        assert hits.t.tobytes() == same.t.tobytes()
        assert hits.prim.tobytes() == same.prim.tobytes()


def test_a_refit_that_exact_refuses_changes_nothing():
    scene = wive.Scene(VERTICES, FACES, accuracy="exact")
    with pytest.raises(ValueError, match=r"np\.float32"):
        scene.refit(VERTICES.astype(np.float64) + 0.1)
    assert scene.intersect(*RAY).mask.all()


def test_the_dtype_of_the_vertices_decides_the_precision():
    double = Table(*VERTICES.T.astype(np.float64))
    for vertices, precision in (
        (VERTICES.astype(np.float64), "float64"),
        (double, "float64"),
        (VERTICES, "float32"),
        (Table(*VERTICES.T), "float32"),
        (VERTICES.astype(np.longdouble), "float32"),
        (VERTICES.astype(np.int64), "float32"),
        (VERTICES.tolist(), "float32"),
        ([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], "float32"),
    ):
        assert wive.Scene(vertices, FACES).precision == precision
        assert wive.Scene(vertices, FACES, accuracy="exact").precision == "float32"


QUERIES = ("intersect", "occluded", "count", "intersect_all")


def found(scene, query, rays):
    answer = getattr(scene, query)(*rays)
    if query == "intersect":
        return answer.mask
    return answer.counts > 0 if query == "intersect_all" else answer > 0


@pytest.mark.parametrize("accuracy", ["watertight", "exact"])
def test_masked_rays_miss(backend, accuracy):
    scene = wive.Scene(VERTICES, FACES, backend=backend, accuracy=accuracy)
    double = wive.Scene(VERTICES.astype(np.float64), FACES)
    origins, directions = np.tile(np.float32(RAY[0]), (4, 1)), np.tile(np.float32(RAY[1]), (4, 1))
    one = np.zeros((4, 3), bool)
    one[1, 2] = True
    expected = ~one.any(axis=1)

    def mask(array, where, dtype=None):
        return np.ma.masked_array(array.astype(dtype or array.dtype), mask=where)

    many = np.array([0, 1, 0, 0], bool)
    for rays in (
        (mask(origins, one), directions),
        (mask(origins, one, np.float64), directions),
        (origins, mask(directions, one)),
        (origins, mask(directions, one, int)),
        (list(mask(origins, one)), directions),
        (origins, directions, mask(np.zeros(4), many)),
        (origins, directions, 0, mask(np.full(4, 9, int), many)),
    ):
        for query in QUERIES:
            np.testing.assert_array_equal(found(scene, query, rays), expected)
            np.testing.assert_array_equal(found(double, query, rays), expected)
    for rays in ((origins, directions, np.ma.masked), (origins, directions, 0, np.ma.masked)):
        assert not scene.occluded(*rays).any()
    none = np.ma.masked_array(origins, mask=False), np.ma.masked_array(directions)
    assert scene.occluded(*none).all()


def test_masked_meshes_and_cameras_are_refused():
    masked = np.ma.masked_array(VERTICES, mask=[[0, 0, 0], [0, 1, 0], [0, 0, 0]])
    scene = wive.Scene(VERTICES, FACES)
    for call in (
        lambda: wive.Scene(masked, FACES),
        lambda: scene.refit(masked),
        lambda: scene.refit(list(masked)),
    ):
        with pytest.raises(
            ValueError, match=r"^vertices must be .*, got 1 that are masked: fill or remove them"
        ):
            call()
    with pytest.raises(ValueError, match=r"^faces must be .*, got 2 that are masked"):
        wive.Scene(VERTICES, np.ma.masked_array(FACES, mask=[[0, 1, 1]]))
    with pytest.raises(ValueError, match=r"^eye must be .*, got 1 that are masked"):
        wive.Camera(np.ma.masked_array([0, 0, 5.0], mask=[1, 0, 0]), (0, 0, 0))
    whole = np.ma.masked_array(VERTICES, mask=False)
    assert wive.Scene(whole, np.ma.masked_array(FACES)).intersect(*RAY).mask.all()


@pytest.mark.parametrize("value", [NAN, INF, -INF, 1e30])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_vertices_that_no_face_uses_may_hold_anything(backend, value, dtype, tmp_path):
    if backend == "warp" and not (np.isnan(value) and dtype == np.float32):
        pytest.skip("the tree is built by the same core")
    vertices, faces = sphere(2)
    rays = random_rays(200, seed=1, low=-1.5, high=1.5)
    bad = np.full((1, 3), value, dtype)
    odd = np.concatenate([bad, vertices.astype(dtype)[:50], bad, vertices.astype(dtype)[50:], bad])
    moved = np.where(faces < 50, faces + 1, faces + 2).astype(np.int32)
    for options in ({}, {"accuracy": "exact"}, {"nodes": "compressed"}, {"quality": "high"}):
        if value == 1e30 and dtype == np.float64 and "accuracy" in options:
            continue  # float32 does not hold it
        plain = wive.Scene(vertices.astype(dtype), faces, backend=backend, **options)
        scene = wive.Scene(odd, moved, backend=backend, **options)
        expected = plain.intersect(*rays)
        assert expected.mask.sum() > 20
        np.testing.assert_array_equal(scene.bounds, plain.bounds)
        scene.save(tmp_path / "scene")
        again = wive.load(tmp_path / "scene"), pickle.loads(pickle.dumps(scene))
        scene.refit(odd)
        for one in (scene, *again):
            hits = one.intersect(*rays)
            for name in ("t", "prim", "uv"):
                np.testing.assert_array_equal(getattr(hits, name), getattr(expected, name))
            np.testing.assert_array_equal(hits.points(), expected.points())
    with pytest.raises(ValueError, match=r"vertices\[51\]"):
        wive.Scene(odd, np.vstack([moved, [[51, 1, 2]]]), backend=backend)


def test_float64_copies_of_float32_rays_give_the_same_hits_near_by():
    scene = wive.Scene(*sphere(3))
    origins, directions = random_rays(500, seed=3, low=-60, high=60)
    doubles = origins.astype(np.float64), directions.astype(np.float64)
    assert_same_hits(scene.intersect(*doubles), scene.intersect(origins, directions))


class Unreadable:
    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("two\nlines")


@pytest.mark.parametrize(
    "value", [None, "abc", Unreadable(), [["a", "b", "c"]],
              [[1j, 0, 0]], [[True, False, True]], np.zeros((1, 3), "M8[s]"),
              [[{}, 1, 2]], {"a": 1}, [[1, 2], [1, 2, 3]]]
)  # fmt: skip
def test_what_holds_no_numbers_is_refused_in_one_line(value):
    scene = wive.Scene(VERTICES, FACES)
    for name, call in {
        "vertices": lambda: wive.Scene(value, FACES),
        "faces": lambda: wive.Scene(VERTICES, value),
        "origins": lambda: scene.intersect(value, [0, 0, 1]),
        "directions": lambda: scene.occluded([0, 0, 1], value),
        "tmin": lambda: scene.count(*RAY, value),
        "tmax": lambda: scene.intersect_all(*RAY, 0, value),
    }.items():
        with pytest.raises((TypeError, ValueError)) as error:
            call()
        assert str(error.value).startswith(f"{name} must be")
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("scene_dtype", [np.float32, np.float64])
def test_signalling_nans_are_nans_without_a_warning(scene_dtype, dtype):
    """NumPy warns when it converts one; its bits may come from any file."""
    bits = {2: 0x7D00, 4: 0x7FA00000, 8: 0x7FF4000000000000}[np.dtype(dtype).itemsize]
    nan = np.array(bits, f"u{np.dtype(dtype).itemsize}").view(dtype)
    unused = np.concatenate([VERTICES.astype(dtype), np.full((1, 3), nan)]).astype(dtype)
    scenes = wive.Scene(unused, FACES), wive.Scene(VERTICES.astype(scene_dtype), FACES)
    rays = np.tile(np.array(RAY[0], dtype), (3, 1)), np.tile(np.array(RAY[1], dtype), (3, 1))
    tmin = np.array([0, nan, 0], dtype)
    rays[0][2, 1] = nan
    for scene in scenes:
        for z in (-1, -1000):  # the latter is brought near
            rays[0][:, 2] = z
            hits = scene.intersect(*rays, tmin)
            assert hits.mask.tolist() == np.isfinite(hits.error_bound).tolist() == [True, False, False]
