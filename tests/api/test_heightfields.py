# ruff: noqa: E501
"""Scenes over grids of heights: against the plane through three heights of each cell, cell by cell."""

import numpy as np
import pytest
from support.foreign_arrays import Foreign

import wive

ROWS, COLUMNS = 6, 5
NAN = float("nan")


def grid(dtype=np.float64, x_step=1.0, y_step=1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights and axes in uneven steps; a negative step makes an axis descend."""
    random = np.random.default_rng(3)
    x = np.cumsum(random.uniform(0.5, 2, COLUMNS)) * x_step
    y = np.cumsum(random.uniform(0.5, 2, ROWS)) * y_step
    return random.uniform(0, 3, (ROWS, COLUMNS)).astype(dtype), x.astype(dtype), y.astype(dtype)


def height_in_cell(z, i, j, row: float, column: float) -> float:
    """Height at a place in cell [i, j], row and column from 0 to 1, by the diagonal from [i, j] to [i+1, j+1]."""
    a, b, c, d = z[i, j], z[i, j + 1], z[i + 1, j], z[i + 1, j + 1]
    return a + column * (b - a) + row * (d - b) if column >= row else a + row * (c - a) + column * (d - c)


@pytest.mark.parametrize("x_step", [1.0, -1.0])
@pytest.mark.parametrize("y_step", [1.0, -1.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_from_above_meet_the_surface_of_their_cell(backend, x_step, y_step, dtype):
    z, x, y = grid(dtype, x_step, y_step)
    scene = wive.Scene.from_heightfield(z, x, y, backend=backend)
    assert scene.precision == np.dtype(dtype).name
    assert len(scene) == 2 * (ROWS - 1) * (COLUMNS - 1)
    np.testing.assert_array_equal(scene.vertices.reshape(ROWS, COLUMNS, 3)[..., 2], z)
    for i in range(ROWS - 1):
        for j in range(COLUMNS - 1):
            for row, column in ((0.2, 0.7), (0.6, 0.3)):
                place = x[j] + column * (x[j + 1] - x[j]), y[i] + row * (y[i + 1] - y[i])
                hits = scene.intersect([(*place, 100)], [0, 0, -1])
                expected = height_in_cell(z.astype(float), i, j, row, column)
                assert hits.points()[0, 2] == pytest.approx(expected, abs=1e-5)
                assert divmod(hits.prim[0] // 2, COLUMNS - 1) == (i, j)
                assert hits.prim[0] % 2 == (row > column)
                assert hits.normals()[0, 2] > 0
                assert hits.front[0]


@pytest.mark.parametrize("masked", [False, True])
def test_cells_at_a_missing_height_are_holes_and_all_others_are_there(masked):
    z, x, y = grid()
    holes = np.zeros(z.shape, bool)
    holes[[0, 2, 3], [0, 2, 4]] = True
    full = wive.Scene.from_heightfield(z, x, y)
    if masked:
        z[holes] = -9999
        given = np.ma.MaskedArray(z, holes)
    else:
        given = np.where(holes, NAN, z)
    scene = wive.Scene.from_heightfield(given, x, y)
    assert len(scene) == len(full)
    assert scene.bounds[0, 2] >= 0
    for i in range(ROWS - 1):
        for j in range(COLUMNS - 1):
            above = [((x[j] + x[j + 1]) / 2, (2 * y[i] + y[i + 1]) / 3, 100)]
            hit, expected = (one.intersect(above, [0, 0, -1]) for one in (scene, full))
            if holes[i : i + 2, j : j + 2].any():
                assert not hit.mask[0]
            else:
                assert hit.prim[0] == expected.prim[0]
                assert hit.t[0] == expected.t[0]
    border = [(x[j], y[i], 100) for i in range(ROWS) for j in range(COLUMNS)]
    np.testing.assert_array_equal(
        scene.intersect(border, [0, 0, -1]).mask,
        [any(not holes[r : r + 2, c : c + 2].any()
             for r in range(max(i - 1, 0), min(i + 1, ROWS - 1))
             for c in range(max(j - 1, 0), min(j + 1, COLUMNS - 1)))
         for i in range(ROWS) for j in range(COLUMNS)],
    )  # fmt: skip


@pytest.mark.parametrize("known", [0, 1, 3])
def test_a_grid_without_a_whole_cell_is_hit_nowhere(backend, known):
    z = np.full((3, 3), NAN)
    z.ravel()[:known] = 1
    scene = wive.Scene.from_heightfield(z, [0, 1, 2], [0, 1, 2], backend=backend)
    assert not scene.intersect([[0.5, 0.5, 5]], [0, 0, -1]).mask.any()


def test_a_heightfield_has_no_leak_between_its_triangles():
    z, x, y = grid(np.float32)
    scene = wive.Scene.from_heightfield(z, x, y)
    random = np.random.default_rng(5)
    ends = scene.vertices[scene.faces[:, [0, 1, 1, 2, 2, 0]]].reshape(-1, 2, 3)
    inner = ends[((ends[:, :, 0] > x[0]) & (ends[:, :, 0] < x[-1])).all(axis=1)]
    inner = inner[((inner[:, :, 1] > y[0]) & (inner[:, :, 1] < y[-1])).all(axis=1)]
    middles = inner.mean(axis=1)
    shifts = random.uniform(-3, 3, middles.shape) + np.array([0, 0, 50])
    origins = (middles + shifts).astype(np.float32)
    assert scene.intersect(origins, (middles - origins).astype(np.float32)).mask.all()


@pytest.mark.parametrize(
    ("of_z", "of_x", "precision"),
    [
        (np.float64, np.float64, "float64"),
        (np.float32, np.float64, "float64"),
        (np.float64, np.float32, "float64"),
        (np.float32, np.float32, "float32"),
        (np.int16, np.float32, "float32"),
        (np.uint8, np.int64, "float32"),
        (np.int16, np.float64, "float64"),
        (list, list, "float32"),
    ],
)
def test_an_array_of_float64_makes_a_float64_scene(of_z, of_x, precision):
    z, x = np.arange(9).reshape(3, 3), 500_000 + np.arange(3)
    given = [a.tolist() if of is list else a.astype(of) for a, of in ((z, of_z), (x, of_x), (x, of_x))]
    scene = wive.Scene.from_heightfield(*given)
    assert scene.precision == precision
    np.testing.assert_array_equal(scene.vertices[:, 2], z.ravel())
    masked = np.ma.MaskedArray(z, z == 8)
    assert wive.Scene.from_heightfield(masked, *given[1:]).precision == (
        "float64" if of_x is np.float64 else "float32"
    )


def test_options_and_other_arrays_are_taken():
    z, x, y = grid(np.float32)
    scene = wive.Scene.from_heightfield(z, x, y, accuracy="exact", nodes="compressed", backend="scalar")
    assert (scene.accuracy, scene.nodes, scene.backend) == ("exact", "compressed", "scalar")
    for make in (Foreign.Array, np.ndarray.tolist, np.asfortranarray):
        other = wive.Scene.from_heightfield(make(z), make(x), make(y))
        np.testing.assert_array_equal(other.vertices, scene.vertices)
        np.testing.assert_array_equal(other.faces, scene.faces)
    with pytest.raises(ValueError, match="must be float32 numbers for accuracy 'exact'"):
        wive.Scene.from_heightfield(z, np.arange(COLUMNS) + 2**24, y, accuracy="exact")


Z = np.zeros((3, 4))


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        ((np.zeros(4), range(4), range(3)), ValueError, "z must have shape (rows, columns), at least (2, 2), got (4,)"),
        ((np.zeros((1, 4)), range(4), [0]), ValueError, "z must have shape (rows, columns), at least (2, 2), got (1, 4)"),
        ((np.zeros((0, 0)), [], []), ValueError, "z must have shape (rows, columns), at least (2, 2), got (0, 0)"),
        ((Z, range(3), range(4)), ValueError, "x must have shape (4,), one per column of z, got (3,)"),
        ((Z, range(4), range(4)), ValueError, "y must have shape (3,), one per row of z, got (4,)"),
        ((Z, *np.meshgrid(range(4), range(3))), ValueError, "x must have shape (4,), one per column of z, got (3, 4): pass one row or column of the grid"),
        ((Z, 1.0, range(3)), ValueError, "x must have shape (4,), one per column of z, got ()"),
        ((Z, [0, 1, 1, 2], range(3)), ValueError, "x must ascend or descend from column to column, got 1 after 1 at 2"),
        ((Z, range(4), np.array([5, 4, 4.5])), ValueError, "y must ascend or descend from row to row, got 4.5 after 4.0 at 2"),
        ((Z.astype(np.float32), [7e7, 7e7 + 1, 8e7, 9e7], range(3)), ValueError, "x must differ from column to column in float32, the scene's precision, got 70000000.0 and 70000001.0 at 1, both 70000000.0: subtract a number from x, or make a float64 scene"),
        ((Z, [0, 1, NAN, 2], range(3)), ValueError, "x must be finite, got nan at 2"),
        ((Z, range(4), np.ma.MaskedArray([0.0, 1, 2], [False, True, False])), ValueError, "y must be finite, got nan at 1"),
        ((np.where(np.eye(3, 4), np.inf, Z), range(4), range(3)), ValueError, "z must be finite, or NaN or masked for holes, got inf at [0, 0]"),
        (([["a"] * 4] * 3, range(4), range(3)), TypeError, "z must be an array of real numbers, got dtype <U1: convert it first"),
        ((Z, None, range(3)), TypeError, "x must be an array of real numbers, got NoneType: convert it first"),
        (([[1, 2], [3]], range(2), range(2)), ValueError, "z must be an array of real numbers, got rows of unequal length"),
    ],
)  # fmt: skip
def test_grids_of_no_sense_are_refused_in_one_line(arguments, kind, message):
    with pytest.raises(kind) as error:
        wive.Scene.from_heightfield(*arguments)
    assert str(error.value) == message


def test_steps_that_the_scenes_precision_cannot_hold_are_refused_and_others_taken():
    """Survey coordinates in steps of a centimetre: as float32 all of a row fell into one place, unhit."""
    z, northing = np.zeros((3, 4)), 4_042_318 + np.arange(3.0)
    easting = 743_512 + 0.01 * np.arange(4)
    above, down = [(easting[1] + 0.002, northing[1] + 0.3, 9.0)], (0, 0, -1)
    assert wive.Scene.from_heightfield(z, easting, northing).occluded(above, down).all()
    for options in ({"dtype": np.float32}, {"dtype": "float32", "accuracy": "exact"}):
        with pytest.raises(ValueError, match=r"^x must differ from column to column in float32"):
            wive.Scene.from_heightfield(z, easting, northing, **options)
    rounded = wive.Scene.from_heightfield(z, easting - 743_512, northing - 4_042_318, dtype=np.float32)
    assert rounded.occluded([(0.012, 1.3, 9)], down).all()
