"""Hits of rays in dask arrays are the scene's own: any chunks, shapes, limits, precisions and options."""

import numpy as np
import pytest
from support.dask_arrays import (
    COUNT,
    DIRECTIONS,
    LIMITS,
    ORIGINS,
    all_same,
    da,
    dask,
    in_chunks,
    same,
    scene_of,
)
from support.meshes import assert_same_hits

import wive
import wive.dask

# Unequal chunks, empty ones, the vector axis in pieces, one chunk.
CHUNKS = [((7, 0, 500, 93), (2, 1)), (100, 3), (COUNT, 1)]
OF_HITS = "t", "prim", "uv", "mask", "geom", "geom_prim", "front", "error_bound"
OF_ALL_HITS = "offsets", "counts", "ray", "t", "prim", "uv", "geom", "geom_prim"
METHODS = "points", "normals", "cosines"


@pytest.mark.parametrize(
    ("chunks", "options"),
    [*((chunks, {}) for chunks in CHUNKS), (CHUNKS[0], {"accuracy": "exact"}), (200, {"dtype": np.float64})],
)
def test_every_array_of_hits_is_that_of_the_scene(chunks, options):
    scene = scene_of(**options)
    expected = scene.intersect(ORIGINS, DIRECTIONS)
    hits = wive.dask.intersect(scene, in_chunks(ORIGINS, chunks), in_chunks(DIRECTIONS, (250, 3)))
    assert hits.shape == hits.t.shape == (COUNT,) and len(hits) == COUNT
    pairs = [(getattr(hits, name), getattr(expected, name)) for name in OF_HITS]
    pairs += [(getattr(hits, name)(), getattr(expected, name)()) for name in METHODS]
    for directions in (DIRECTIONS, in_chunks(DIRECTIONS, chunks), (0.0, 0.0, 1.0)):
        pairs.append((hits.spawn(directions), expected.spawn(np.asarray(directions))))
    for values in (scene.vertices, scene.vertices[:, 0].astype(np.float16)):
        pairs.append((hits.interpolate(values), expected.interpolate(values)))
    all_same(pairs)
    whole = hits.compute()
    assert_same_hits(whole, expected)
    np.testing.assert_array_equal(whole.points(), expected.points())
    np.testing.assert_array_equal(whole.spawn(DIRECTIONS), expected.spawn(DIRECTIONS))


@pytest.mark.parametrize("chunks", CHUNKS[:2])
def test_every_array_of_all_hits_is_that_of_the_scene(chunks):
    scene = scene_of()
    expected = scene.intersect_all(ORIGINS, DIRECTIONS, 0.1, LIMITS)
    rays = in_chunks(ORIGINS, chunks), in_chunks(DIRECTIONS, (250, 3))
    hits = wive.dask.intersect_all(scene, *rays, 0.1, in_chunks(LIMITS, 77))
    assert len(hits) == COUNT and len(expected.t) > 200
    pairs = [(getattr(hits, name), getattr(expected, name)) for name in OF_ALL_HITS]
    pairs += [(getattr(hits, name)(), getattr(expected, name)()) for name in ("points", "normals")]
    all_same(pairs)
    chunk_hits = dask.compute(*hits.to_delayed())
    assert sum(map(len, chunk_hits)) == COUNT
    for whole in (hits.compute(), hits.persist().compute()):
        for name in OF_ALL_HITS:
            np.testing.assert_array_equal(getattr(whole, name), getattr(expected, name))
        np.testing.assert_array_equal(whole.points(), expected.points())
        assert whole.counts.dtype == np.int32


@pytest.mark.parametrize("name", ["occluded", "count"])
def test_limits_are_numbers_or_arrays_in_any_chunks(name):
    scene = scene_of()
    rays = in_chunks(ORIGINS), in_chunks(DIRECTIONS, (250, 2))
    query, expected = getattr(wive.dask, name), getattr(scene, name)
    same(query(scene, *rays), expected(ORIGINS, DIRECTIONS))
    for low in (0.25, in_chunks(LIMITS, 41).min(), np.float32(0.25)):
        for high in (LIMITS, in_chunks(LIMITS, 41), list(LIMITS)):
            least = low.compute() if isinstance(low, da.Array) else low
            same(query(scene, *rays, low, high), expected(ORIGINS, DIRECTIONS, least, LIMITS))
    same(query(scene, *rays, tmin=3, tmax=2), expected(ORIGINS, DIRECTIONS, 3, 2))


def test_triangles_that_are_touched_count():
    scene = wive.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    edge = in_chunks(np.array([[0.5, 0, 1], [0, 0.5, 1], [0.5, 0.5, 1], [0.2, 0.2, 1]], np.float32), (2, 3))
    for touching in (False, True):
        expected = scene.count(edge.compute(), (0, 0, -1), touching=touching)
        same(wive.dask.count(scene, edge, (0, 0, -1), touching=touching), expected)
        every = wive.dask.intersect_all(scene, edge, (0, 0, -1), touching=touching)
        same(every.counts, expected)
    assert expected.tolist() == [1, 1, 1, 1]


def test_masked_rays_miss():
    scene = scene_of()
    masked = np.ma.masked_array(ORIGINS, np.arange(3 * COUNT).reshape(-1, 3) % 7 == 0)
    origins = da.ma.masked_array(in_chunks(ORIGINS), in_chunks(np.ma.getmaskarray(masked)))
    same(wive.dask.intersect(scene, origins, in_chunks(DIRECTIONS)).t, scene.intersect(masked, DIRECTIONS).t)


@pytest.mark.parametrize("row", [(0.5, 0.5, -2.0), np.array([0.5, 0.5, -2.0], np.float32)])
def test_a_row_or_an_array_of_numpy_goes_with_a_dask_array(row):
    scene = scene_of()
    same(wive.dask.intersect(scene, row, in_chunks(DIRECTIONS)).t, scene.intersect(row, DIRECTIONS).t)
    same(wive.dask.intersect(scene, in_chunks(ORIGINS), row).t, scene.intersect(ORIGINS, row).t)
    same(wive.dask.count(scene, ORIGINS, in_chunks(DIRECTIONS)), scene.count(ORIGINS, DIRECTIONS))
    lazy = da.from_array(np.array(row), chunks=2)
    same(wive.dask.occluded(scene, lazy, in_chunks(DIRECTIONS)), scene.occluded(row, DIRECTIONS))
    same(wive.dask.occluded(scene, lazy, DIRECTIONS), scene.occluded(row, DIRECTIONS))
    same(wive.dask.intersect(scene, lazy, row).uv, scene.intersect(row, row).uv)


@pytest.mark.parametrize("chunks", [(11, 9, 2), (-1, -1, 3)])
def test_rays_of_a_picture_give_hits_of_its_shape(chunks):
    scene = scene_of()
    shape = (30, 20, 3)
    origins, directions = ORIGINS.reshape(shape), DIRECTIONS.reshape(shape)
    rays = in_chunks(origins, chunks), in_chunks(directions, (11, 20, 3))
    expected = scene.intersect(origins, directions)
    hits = wive.dask.intersect(scene, *rays, tmax=in_chunks(LIMITS.reshape(30, 20) + 9, 10))
    for name in ("t", "uv", "mask"):
        same(getattr(hits, name), getattr(expected, name))
    same(hits.points(), expected.points())
    for whole in (hits.compute(), hits.persist().compute()):
        assert whole.uv.shape == (30, 20, 2)
        np.testing.assert_array_equal(whole.t, expected.t)
        np.testing.assert_array_equal(whole.points(), expected.points())
    flat = scene.intersect_all(ORIGINS, DIRECTIONS, 0, LIMITS)
    every = wive.dask.intersect_all(scene, *rays, 0, LIMITS.reshape(30, 20))
    for name in ("offsets", "ray", "prim"):
        same(getattr(every, name), getattr(flat, name))


@pytest.mark.parametrize("shape", [(0, 3), (0, 5, 3), (4, 0, 3)])
def test_no_rays_have_no_hits(shape):
    scene = scene_of()
    rays = da.zeros(shape), da.ones(shape, dtype=np.float32)
    hits = wive.dask.intersect(scene, *rays)
    same(hits.uv, np.zeros((*shape[:-1], 2), np.float32))
    same(hits.points(), np.zeros(shape))
    assert hits.compute().t.shape == shape[:-1]
    same(wive.dask.occluded(scene, *rays), np.zeros(shape[:-1], bool))
    every = wive.dask.intersect_all(scene, *rays)
    same(every.offsets, np.zeros(1, np.int64))
    same(every.ray, np.zeros(0, np.int64))
    assert len(every.compute()) == 0


def test_rays_that_a_mask_chose_are_in_chunks_of_unknown_sizes():
    scene = scene_of()
    first = scene.intersect(ORIGINS, DIRECTIONS)
    hits = wive.dask.intersect(scene, in_chunks(ORIGINS), in_chunks(DIRECTIONS))
    onward = in_chunks(DIRECTIONS)[hits.mask]
    origins = hits.spawn(in_chunks(DIRECTIONS))[hits.mask]
    given = first.spawn(DIRECTIONS)[first.mask], DIRECTIONS[first.mask]
    same(wive.dask.intersect(scene, origins, onward).t, scene.intersect(*given).t)
    same(wive.dask.count(scene, origins, (0, 0, 1)), scene.count(given[0], (0, 0, 1)))
    every = wive.dask.intersect_all(scene, origins, onward)
    same(every.t, scene.intersect_all(*given).t)
    with pytest.raises(ValueError, match=r"^rays must be in chunks of known sizes to be numbered: call comp"):
        every.ray  # noqa: B018
    with pytest.raises(ValueError, match=r"^directions must be a dask array, as the rays are in chunks"):
        wive.dask.intersect(scene, origins, DIRECTIONS)
    for other in (
        in_chunks(DIRECTIONS)[: first.mask.sum()],
        in_chunks(DIRECTIONS, (50, 3))[da.repeat(hits.mask, 1)],
    ):
        with pytest.raises(
            ValueError, match=r"^origins and directions must be in the same chunks, as some [^\n]*$"
        ):
            wive.dask.occluded(scene, origins, other)
