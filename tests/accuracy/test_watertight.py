"""Closed surfaces do not leak: rays aimed at edges and vertices, at any place and scale, on every backend."""

import numpy as np
import pytest
from support.closed_meshes import DIRECTIONS, SCALES, grid
from support.meshes import sphere

import wive

PLACES = [(0.0, 0.0, 0.0), (148376.0, 1234.0, -223423.0), (-3e6, 2e6, 1e6)]
RAYS = 20_000


def aims(vertices: np.ndarray, faces: np.ndarray, kind: str, random: np.random.Generator) -> np.ndarray:
    """Points at vertices, at points of edges, or in faces, of the float32 mesh."""
    chosen = vertices[faces[random.integers(len(faces), size=RAYS)]].astype(np.float64)
    if kind == "vertices":
        return chosen[:, 0]
    if kind == "edges":
        s = random.random((RAYS, 1))
        return chosen[:, 0] * s + chosen[:, 1] * (1 - s)
    return chosen.mean(axis=1)


def outwards(vertices: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays from the middle of the mesh to the targets, both rounded to float32."""
    middle = (vertices.min(axis=0).astype(np.float64) + vertices.max(axis=0)) / 2
    origins = np.broadcast_to(middle.astype(np.float32), targets.shape)
    return origins, (targets - origins).astype(np.float32)


@pytest.mark.parametrize("kind", ["vertices", "edges", "faces"])
@pytest.mark.parametrize("scale", SCALES)
def test_closed_sphere_never_leaks_at_any_scale(backend: str, kind: str, scale: float) -> None:
    vertices, faces = sphere(5, radius=scale)
    origins, directions = outwards(vertices, aims(vertices, faces, kind, np.random.default_rng(1)))
    scene = wive.Scene(vertices, faces, backend=backend)
    assert scene.occluded(origins, directions).all()
    assert scene.intersect(origins, directions).mask.all()


@pytest.mark.parametrize("kind", ["vertices", "edges"])
@pytest.mark.parametrize("place", PLACES)
def test_closed_sphere_never_leaks_far_from_the_origin(
    backend: str, kind: str, place: tuple[float, ...]
) -> None:
    vertices, faces = sphere(4, radius=1000.0)
    vertices = (vertices + np.array(place)).astype(np.float32)
    origins, directions = outwards(vertices, aims(vertices, faces, kind, np.random.default_rng(2)))
    assert wive.Scene(vertices, faces, backend=backend).intersect(origins, directions).mask.all()


def test_closed_sphere_never_leaks_from_anywhere_inside(backend: str) -> None:
    random = np.random.default_rng(3)
    vertices, faces = sphere(4)
    targets = aims(vertices, faces, "vertices", random)
    origins = (0.5 * random.uniform(-1, 1, targets.shape)).astype(np.float32)
    assert (
        wive.Scene(vertices, faces, backend=backend)
        .intersect(origins, (targets - origins).astype(np.float32))
        .mask.all()
    )


def test_fast_mode_does_leak_so_these_rays_can_tell(backend: str) -> None:
    vertices, faces = sphere(5)
    leaks = 0
    for kind in ("vertices", "edges"):
        origins, directions = outwards(vertices, aims(vertices, faces, kind, np.random.default_rng(1)))
        leaks += (
            ~wive.Scene(vertices, faces, backend=backend, accuracy="fast").occluded(origins, directions)
        ).sum()
    assert leaks > 0


def test_axis_rays_through_grid_vertices_cross_the_box_exactly(backend: str) -> None:
    vertices, faces = grid(8)
    scene = wive.Scene(vertices, faces, backend=backend)
    points = np.stack(np.meshgrid(np.arange(1, 8), np.arange(1, 8), indexing="ij"), axis=-1).reshape(-1, 2)
    for axis in range(3):
        for sign in (1.0, -1.0):
            origins = np.insert(points, axis, -5 if sign > 0 else 13, axis=1).astype(np.float32)
            directions = np.zeros_like(origins)
            directions[:, axis] = sign
            assert (scene.intersect(origins, directions).t == 5).all()


def test_signed_zeros_and_axis_directions_all_hit_from_inside(backend: str) -> None:
    vertices, faces = grid(4)
    scene = wive.Scene(vertices, faces, backend=backend)
    origins = np.full_like(DIRECTIONS, 2.0)  # in the middle, on grid planes in every axis
    hits = scene.intersect(origins, DIRECTIONS)
    moving = np.abs(DIRECTIONS).max(axis=1) > 0
    assert hits.mask[moving].all() and not hits.mask[~moving].any()
    assert (hits.t[moving] == 2).all()


def test_origin_on_a_slab_plane_with_direction_zero_there_still_hits(backend: str) -> None:
    # The ray runs in the plane x = 0, the side of every box that it should enter.
    vertices, faces = sphere(3)
    half = vertices[faces].reshape(-1, 3).copy()
    half[:, 0] = np.abs(half[:, 0])
    scene = wive.Scene(half, np.arange(len(half), dtype=np.int32).reshape(-1, 3), backend=backend)
    for zero in (0.0, -0.0):
        hits = scene.intersect(np.float32([[0, 0.01, -5]]), np.float32([[zero, 0, 1]]))
        assert hits.mask.all()


def test_a_ray_in_a_triangles_plane_misses_it(backend: str) -> None:
    vertices, faces = np.float32([[0, 0, 0], [4, 0, 0], [0, 4, 0]]), np.int32([[0, 1, 2]])
    origins = np.float32([[-1, 1, 0], [1, -1, 0], [5, 5, 0], [1, 1, 0]])
    directions = np.float32([[1, 0, 0], [0, 1, 0], [-1, -1, 0], [1, 0, 0]])
    for accuracy in ("fast", "watertight"):
        scene = wive.Scene(vertices, faces, backend=backend, accuracy=accuracy)
        assert not scene.intersect(origins, directions).mask.any()
        assert not scene.occluded(origins, directions).any()


@pytest.mark.parametrize("gap", [1e-5, 1e-6, 2e-7])
def test_the_nearer_of_two_walls_is_hit_however_thin_the_gap(backend: str, gap: float) -> None:
    square = np.float32([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
    walls = np.concatenate([square + np.float32([0, 0, gap]), square])
    assert walls[0, 2] > walls[4, 2]
    faces = np.int32([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    random = np.random.default_rng(5)
    directions = np.append(random.uniform(-0.9, 0.9, (5000, 2)), np.ones((5000, 1)), axis=1).astype(
        np.float32
    )
    hits = wive.Scene(walls, faces, backend=backend).intersect(np.zeros_like(directions), directions)
    assert (hits.t == 1).all()
    assert (hits.prim >= 2).all()


def test_of_coincident_triangles_the_lowest_number_is_hit(backend: str) -> None:
    vertices, faces = sphere(2)
    random = np.random.default_rng(6)
    copies = np.concatenate([faces[random.permutation(len(faces))] for _ in range(3)])
    origins, directions = outwards(vertices, aims(vertices, faces, "faces", random))
    hits = wive.Scene(vertices, copies, backend=backend).intersect(origins, directions)
    first = {tuple(sorted(face)): index for index, face in reversed(list(enumerate(copies.tolist())))}
    assert all(first[tuple(sorted(copies[prim].tolist()))] == prim for prim in hits.prim)


def test_t_is_the_nearest_float_to_the_exact_distance(backend: str) -> None:
    # In a plane z = 3 from origins of z = 0, t is 3 / z of the direction.
    vertices, faces = np.float32([[-9, -9, 3], [9, -9, 3], [0, 9, 3]]), np.int32([[0, 1, 2]])
    random = np.random.default_rng(7)
    directions = random.uniform(-0.5, 0.5, (4000, 3)).astype(np.float32)
    directions[:, 2] = random.uniform(0.5, 8, 4000).astype(np.float32)
    hits = wive.Scene(vertices, faces, backend=backend).intersect(np.zeros_like(directions), directions)
    exact = (3.0 / directions[:, 2].astype(np.float64)).astype(np.float32)
    assert np.array_equal(hits.t, exact)


@pytest.mark.parametrize("length", [1e38, 1e-30, 1e-40, 1e-42, 1.4e-45])
def test_directions_of_any_length_hit_a_wall(backend: str, length: float) -> None:
    vertices, faces = grid(64)
    random = np.random.default_rng(9)
    origins = np.append(np.full((2000, 1), 30.0), random.uniform(0, 64, (2000, 2)), axis=1).astype(np.float32)
    directions = np.zeros_like(origins)
    directions[:, 0] = length
    scene = wive.Scene(vertices, faces, backend=backend)
    assert scene.intersect(origins, directions).mask.all()
    assert scene.occluded(origins, directions).all()


def test_a_hit_is_found_again_with_tmax_at_its_own_distance(backend: str) -> None:
    # Nearly coplanar triangles, rays nearly in their plane: t is as sensitive as possible.
    random = np.random.default_rng(10)
    across = np.linalg.qr(np.array([[1.0, 0.7, 0.3], [0, 1, 0], [0, 0, 1]]).T)[0].T
    flat = np.append(random.uniform(-1, 1, (1200, 2)), 3e-7 * random.standard_normal((1200, 1)), axis=1)
    vertices = (flat @ np.stack([across[1], across[2], across[0]])).astype(np.float32)
    scene = wive.Scene(vertices, np.arange(1200, dtype=np.int32).reshape(-1, 3), backend=backend)
    ends = np.append(
        random.uniform(-2, 2, (2, 50_000, 2)), 1e-6 * random.standard_normal((2, 50_000, 1)), axis=2
    )
    points = (ends @ np.stack([across[1], across[2], across[0]])).astype(np.float32)
    origins, directions = points[0], points[1] - points[0]
    hits = scene.intersect(origins, directions)
    found = hits.mask
    assert found.sum() > 10_000
    assert scene.occluded(origins[found], directions[found], tmin=0.0, tmax=hits.t[found]).all()


def test_the_hit_of_a_needle_that_double_takes_for_edge_on_is_found_again(backend: str) -> None:
    # Seen from the ray, the needle's corners lie on one line but for what doubles round away.
    needle = np.array(
        [
            [9.99999935e-39, 9.99999915587e17, 1.0],
            [9.99999795e-39, 9.99999778148e17, 0.99999988],
            [9.99999795e-39, 9.99999984307e17, 0.99999964],
        ],
        np.float32,
    )
    scene = wive.Scene(needle, np.array([[0, 1, 2]], np.int32), backend=backend)
    origin = np.array([[-6.226882e7, 9.999999155872727e17, 8.910913e6]], np.float32)
    direction = np.array([[2.0404247e12, -2.5107481e12, -2.9199276e11]], np.float32)
    hits = scene.intersect(origin, direction)
    assert hits.t[0] == pytest.approx(6.226882e7 / 2.0404247e12)
    assert scene.occluded(origin, direction, tmax=hits.t).all()
