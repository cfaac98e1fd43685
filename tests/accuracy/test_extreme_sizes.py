"""Meshes of every size that is allowed: the builder's areas and costs neither overflow nor vanish."""

from typing import Any

import numpy as np
import pytest
from support.meshes import soup, sphere
from support.oracle import truth

import wive
from wive import _cpu

QUALITIES = ("medium", "high")
NODES = ("float32", "compressed")
MOST = 1e18  # coordinates beyond it are refused


def prims_in(bvh: _cpu.Bvh) -> np.ndarray:
    """The triangles in the blocks of an uncompressed tree, in ascending order."""
    rows = bvh.blocks.view(np.int32)[:, 18 if bvh.precision == "float64" else 9]
    return np.sort(rows[rows >= 0])


def corners_of_the_range(count: int, seed: int, dtype: type) -> tuple[np.ndarray, np.ndarray]:
    """Triangles whose corners are near the corners of the largest box that is allowed."""
    random = np.random.default_rng(seed)
    signs = random.choice([-1, 1], (count, 3, 3))
    vertices = (MOST * signs * (1 - 1e-3 * random.random((count, 3, 3)))).reshape(-1, 3).astype(dtype)
    return np.clip(vertices, -MOST, MOST).astype(dtype), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_large_triangle_is_in_the_tree_once(dtype: type, quality: str) -> None:
    mesh = corners_of_the_range(20_000, 1, dtype)
    bvh = _cpu.Bvh(*mesh, quality=quality)
    assert prims_in(bvh).tolist() == list(range(20_000))
    assert np.isfinite(bvh.sah).all()


@pytest.mark.parametrize("nodes", NODES)
@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("copies", [5, 70, 2000])
def test_coincident_large_triangles_are_all_counted(
    backend: str, dtype: type, nodes: Any, quality: Any, copies: int
) -> None:
    vertices = MOST * np.array([[1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    faces = np.tile(np.int32([[0, 1, 2]]), (copies, 1))
    scene = wive.Scene(
        np.clip(vertices.astype(dtype), -MOST, MOST).astype(dtype),
        faces,
        backend=backend,
        nodes=nodes,
        quality=quality,
    )
    rays = np.zeros((20, 3), dtype), np.full((20, 3), -1, dtype)
    assert (scene.count(*rays, -np.inf) == copies).all()
    assert (scene.intersect(*rays, -np.inf).prim == 0).all()
    assert scene.occluded(*rays, -np.inf).all()


@pytest.mark.parametrize("nodes", NODES)
@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("exponent", [-140, -120, -80, 40, 56])
def test_a_mesh_of_any_size_gets_the_tree_of_the_same_mesh_at_another(
    nodes: Any, quality: Any, exponent: int
) -> None:
    """Sizes are powers of two, so that nothing is rounded: the reference has the size 16."""
    vertices, faces = soup(3000, 3)
    vertices = np.round(vertices * 128) / 128  # still exact as subnormal numbers
    reference = _cpu.Bvh(vertices.astype(np.float32), faces, nodes=nodes, quality=quality)
    scaled = _cpu.Bvh((vertices * 2.0**exponent).astype(np.float32), faces, nodes=nodes, quality=quality)
    if exponent >= -100:  # BinMap::least_extent: smaller ranges are halved by number
        rows = slice(6, 8) if nodes == "float32" else slice(2, 4)
        if exponent >= -60:  # smaller projections of triangles vanish, which only the order of slots tells
            np.testing.assert_array_equal(scaled.nodes[:, rows], reference.nodes[:, rows])
        assert scaled.sah == pytest.approx(reference.sah)
    else:
        assert len(scaled.nodes) < 2 * len(reference.nodes)


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("nodes", NODES)
def test_hits_on_large_triangles_are_right(backend: str, nodes: Any, quality: Any) -> None:
    mesh = corners_of_the_range(60, 5, np.float32)
    random = np.random.default_rng(6)
    origins = (random.uniform(-1, 1, (40, 3)) * MOST).astype(np.float32)
    directions = random.standard_normal((40, 3)).astype(np.float32)
    right = truth(*mesh, origins, directions, np.float32(0), np.float32(np.inf))
    scene = wive.Scene(*mesh, backend=backend, accuracy="exact", nodes=nodes, quality=quality)
    hits = scene.intersect(origins, directions)
    np.testing.assert_array_equal(hits.prim, right.prim)
    np.testing.assert_array_equal(hits.t, right.t)


@pytest.mark.parametrize("quality", QUALITIES)
def test_fine_detail_in_the_largest_mesh_keeps_its_boxes(quality: str) -> None:
    """A sphere of radius 1 beside triangles at the limit: most rays into it do not test all of it."""
    ball, faces = sphere(4)
    far, far_faces = corners_of_the_range(50, 7, np.float32)
    vertices = np.vstack([ball.astype(np.float32), far])
    bvh = _cpu.Bvh(vertices, np.vstack([faces, far_faces + len(ball)]).astype(np.int32), quality=quality)
    assert bvh.depth < 12
    assert len(bvh.nodes) < len(faces) / 6
