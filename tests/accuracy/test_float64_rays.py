"""Rays of float64 trees: closed surfaces never leak; limits and detail have double precision."""

import numpy as np
import pytest
from support.float64_trees import (
    ACCURACIES,
    PLACES,
    UTM,
    closest,
    each_form,
    each_kernel,
    hits_it,
    leaving,
    query,
    sphere64,
)

from wive import _cpu


@each_kernel
@each_form
@pytest.mark.parametrize("kind", ["vertices", "edges", "faces"])
@pytest.mark.parametrize("radius", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_closed_sphere_never_leaks_at_any_scale_and_place(
    kernel: str, nodes: str, kind: str, radius: float
) -> None:
    random = np.random.default_rng(3)
    for place in PLACES:
        if radius < 1e-12 * np.abs(place).max() * 1e3:  # double can't represent such a sphere there
            continue
        mesh = sphere64(3, radius, place)
        assert hits_it(_cpu.Bvh(*mesh, nodes=nodes), kernel, *leaving(mesh, kind, 2000, random)).all()


@each_kernel
def test_float32_loses_what_float64_keeps_in_utm_coordinates(kernel: str) -> None:
    # A ball of two metres with triangles of centimetres: in float32, places are half a metre apart there.
    mesh = sphere64(5, 1.0, UTM)
    origins, directions = leaving(mesh, "faces", 4000, np.random.default_rng(4))
    t = closest(_cpu.Bvh(*mesh), kernel, origins, directions)[0]
    points = origins + t[:, None] * directions
    distances = np.linalg.norm(points - UTM, axis=1)
    assert (np.abs(distances - 1) < 1e-3).all()  # chords of that sphere
    rounded = [a.astype(np.float32) for a in (mesh[0], origins, directions)]
    t32 = closest(_cpu.Bvh(rounded[0], mesh[1]), kernel, *rounded[1:])[0]
    assert (np.abs(t32 - t) > 0.1).mean() > 0.3


@each_kernel
def test_triangles_of_a_millimetre_are_resolved_in_utm_coordinates(kernel: str) -> None:
    # A plane of squares of 1 mm, each ray into one triangle of them.
    side = 64
    i, j = (a.ravel() for a in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    grid = np.stack(np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij"), axis=-1)
    vertices = np.append(grid.reshape(-1, 2), np.zeros(((side + 1) ** 2, 1)), axis=1) * 1e-3 + UTM
    corner = i * (side + 1) + j
    lower = np.stack([corner, corner + side + 1, corner + side + 2], axis=1)
    upper = np.stack([corner, corner + side + 2, corner + 1], axis=1)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    targets = vertices[faces].mean(axis=1)
    origins = targets + np.array([0.7, -0.3, 2.0])
    t, prim, uv = closest(_cpu.Bvh(vertices, faces), kernel, origins, targets - origins)
    assert np.array_equal(prim, np.arange(len(faces)))
    assert np.allclose(t, 1, rtol=0, atol=1e-8) and np.allclose(uv, 1 / 3, rtol=0, atol=1e-5)
    narrow = [a.astype(np.float32) for a in (vertices, origins, targets - origins)]
    coarse = closest(_cpu.Bvh(narrow[0], faces), kernel, *narrow[1:])[1]
    assert (coarse == prim).mean() < 0.1


@each_kernel
@each_form
def test_a_hit_is_found_again_with_tmax_at_its_own_distance(kernel: str, nodes: str) -> None:
    # Triangles seen edge-on: t is as sensitive as possible, but never lies outside the triangle's boxes.
    random = np.random.default_rng(7)
    across = np.linalg.qr(np.array([[1.0, 0.7, 0.3], [0, 1, 0], [0, 0, 1]]).T)[0].T
    basis = np.stack([across[1], across[2], across[0]])
    found = 0
    for flatness in (1e-6, 1e-9, 1e-12, 1e-15):
        flat = np.append(
            random.uniform(-1, 1, (1200, 2)), flatness * random.standard_normal((1200, 1)), axis=1
        )
        bvh = _cpu.Bvh(flat @ basis, np.arange(1200, dtype=np.int32).reshape(-1, 3), nodes=nodes)
        ends = np.append(
            random.uniform(-2, 2, (2, 4000, 2)),
            3 * flatness * random.standard_normal((2, 4000, 1)),
            axis=2,
        )
        points = ends @ basis
        origins, directions = points[0], points[1] - points[0]
        t, prim, _ = closest(bvh, kernel, origins, directions)
        hit = prim >= 0
        found += hit.sum()
        again = query(bvh, kernel, "occluded", origins[hit], directions[hit], 0.0, t[hit])[0]
        assert again.all()
    assert found > 4000


@each_kernel
def test_limits_are_closed_and_finer_than_float32(kernel: str) -> None:
    vertices = np.array([[-9, -9, 3 + 1e-12], [9, -9, 3 + 1e-12], [0, 9, 3 + 1e-12]])
    bvh = _cpu.Bvh(vertices, np.int32([[0, 1, 2]]))
    origins, directions = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    t = vertices[0, 2]
    below, above = np.nextafter(t, 0), np.nextafter(t, 9)
    for limits, hit in (
        ((0, t), True),
        ((t, 9), True),
        ((t, t), True),
        ((0, below), False),
        ((above, 9), False),
    ):
        assert query(bvh, kernel, "occluded", origins, directions, *limits)[0][0] == hit
        assert query(bvh, kernel, "count", origins, directions, *limits)[0][0] == hit
        assert closest(bvh, kernel, origins, directions, tmin=limits[0], tmax=limits[1])[0][0] == (
            t if hit else np.inf
        )


@each_kernel
@pytest.mark.parametrize("gap", [1e-3, 1e-9, 1e-15])
def test_the_nearer_of_two_walls_is_hit_however_thin_the_gap(kernel: str, gap: float) -> None:
    square = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], np.float64)
    walls = np.concatenate([square + np.array([0, 0, gap]), square])
    faces = np.int32([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    directions = np.append(np.random.default_rng(8).uniform(-0.9, 0.9, (2000, 2)), np.ones((2000, 1)), axis=1)
    t, prim, _ = closest(_cpu.Bvh(walls, faces), kernel, np.zeros_like(directions), directions)
    assert (t == 1).all() and (prim >= 2).all()


@each_kernel
@pytest.mark.parametrize("length", [1e308, 1e100, 1e-30, 1e-300, 1e-308, 5e-324])
def test_directions_of_any_length_hit_a_wall(kernel: str, length: float) -> None:
    vertices, faces = sphere64(3)
    directions = np.zeros((6, 3))
    directions[np.arange(6), np.arange(6) // 2] = length * np.array([1, -1, 1, -1, 1, -1])
    origins = np.full_like(directions, 1e-3)
    t, prim, _ = closest(_cpu.Bvh(vertices, faces), kernel, origins, directions)
    assert (prim >= 0).all()
    unit = closest(_cpu.Bvh(vertices, faces), kernel, origins, np.sign(directions))
    assert np.array_equal(prim, unit[1])
    if length < 1e308 and length > 1e-300:
        assert np.allclose(t * length, unit[0], rtol=1e-14, atol=0)


COMPONENTS = (-1.0, -0.0, 0.0, -1e-200, 1e-200, 1.0)


@each_kernel
def test_signed_zeros_and_tiny_components_all_hit_from_inside(kernel: str) -> None:
    vertices, faces = sphere64(3, 1.0, UTM)
    directions = np.array([(x, y, z) for x in COMPONENTS for y in COMPONENTS for z in COMPONENTS])
    moving = np.abs(directions).max(axis=1) > 0
    origins = np.broadcast_to(np.float64(UTM), directions.shape).copy()
    assert np.array_equal(hits_it(_cpu.Bvh(vertices, faces), kernel, origins, directions), moving)


@each_kernel
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_rays_without_direction_or_with_nan_miss(kernel: str, accuracy: str) -> None:
    bvh = _cpu.Bvh(*sphere64(2), accuracy)
    bad = [np.nan, np.inf, -np.inf]
    origins = np.zeros((8, 3))
    directions = np.ones((8, 3))
    origins[:3, 1] = bad
    directions[3:6, 2] = bad
    directions[6] = 0
    origins[7, 0] = 1.1e18
    assert not hits_it(bvh, kernel, origins, directions).any()
    one = np.zeros((1, 3)), np.ones((1, 3))
    for tmin, tmax in ((2.0, 1.0), (np.nan, 1.0), (0.0, np.nan), (1e300, np.inf), (-np.inf, -1e300)):
        assert closest(bvh, kernel, *one, tmin=tmin, tmax=tmax)[1][0] == -1
    assert closest(bvh, kernel, *one, tmin=-1e300, tmax=1e300)[1][0] >= 0
