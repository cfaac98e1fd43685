"""A million rays in exact mode against integers: grid-aligned meshes and slivers, no wrong answer allowed."""

import numpy as np
import pytest
from support.hard_sets import few_bits, separate
from support.oracle import cross, dot

import wive

RAYS = 500_000
REACH = 64  # of coordinates and directions: every product below fits into 64 bits


def thin_integers(random: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of integer corners, one the integer point nearest to a point of the opposite side."""
    a, b = random.integers(-REACH, REACH + 1, (2, count, 3))
    c = np.rint(a + random.random((count, 1)) * (b - a)).astype(np.int64)
    return np.stack([a, b, c], axis=1).reshape(-1, 3).astype(np.float32), separate(count)


def terrain(random: np.random.Generator, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Integer heights over a square grid of cells of size 5."""
    x, y = np.meshgrid(5 * np.arange(side + 1), 5 * np.arange(side + 1), indexing="ij")
    vertices = np.stack([x, y, random.integers(-8, 9, x.shape)], axis=-1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1, 1)
    b = a + side + 1
    return vertices, np.concatenate([np.hstack([a, b, a + 1]), np.hstack([a + 1, b, b + 1])]).astype(np.int32)


def closest(
    corners: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """t, prim, uv of the closest hit in [0, inf) of integer rays on (f,3,3) integer corners.

    No quotient of integers below 2^24 is so near to a tie between floats that rounding it to double first
    would change the result.
    """
    count = len(origins)
    prim = np.full(count, -1, np.int32)
    best_height, best_determinant = np.ones(count, np.int64), np.zeros(count, np.int64)
    best_weights = np.zeros((count, 2), np.int64)
    for face, (a, b, c) in enumerate(corners):
        normal = cross(b - a, c - a)
        determinant = dot(directions, normal)
        sign = np.sign(determinant)
        height = dot(a - origins, normal) * sign
        hit = np.flatnonzero((sign != 0) & (height >= 0))
        o, d = origins[hit], directions[hit]
        v = [p - o for p in (a, b, c)]
        weights = np.stack([dot(d, cross(v[k - 2], v[k - 1])) * sign[hit] for k in range(3)], axis=1)
        inside = (weights >= 0).all(axis=1)
        hit, weights = hit[inside], weights[inside]
        height, determinant = height[hit], np.abs(determinant[hit])
        nearer = (
            height * best_determinant[hit] < best_height[hit] * determinant
        )  # faces are in ascending order
        at = hit[nearer]
        prim[at], best_height[at], best_determinant[at] = face, height[nearer], determinant[nearer]
        best_weights[at] = weights[nearer, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (best_height / best_determinant).astype(np.float32)
        uv = (best_weights / best_determinant[:, None]).astype(np.float32)
    return t, prim, uv


def assert_all_exact(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> None:
    corners = vertices[faces].astype(np.int64)
    t, prim, uv = closest(corners, origins.astype(np.int64), directions.astype(np.int64))
    assert (prim >= 0).mean() > 0.05
    for backend in ("scalar", "avx2", "avx512"):
        if not wive.backends()[backend].usable:
            continue
        scene = wive.Scene(vertices, faces, backend=backend, accuracy="exact")
        hits = scene.intersect(origins, directions)
        np.testing.assert_array_equal(hits.prim, prim)
        np.testing.assert_array_equal(hits.t, t)
        np.testing.assert_array_equal(hits.uv, uv)
        np.testing.assert_array_equal(scene.occluded(origins, directions), prim >= 0)
    fast = wive.Scene(vertices, faces, accuracy="fast").intersect(origins, directions)
    assert ((fast.prim != prim) | (fast.t != t) | (fast.uv != uv).any(axis=1))[
        prim >= 0
    ].any()  # the rays tell exact from rounded arithmetic


@pytest.mark.slow
def test_half_a_million_rays_on_a_grid_are_exact() -> None:
    random = np.random.default_rng(41)
    vertices, faces = terrain(random, 10)
    origins = vertices[random.integers(len(vertices), size=RAYS)] + few_bits(random, RAYS, 10)
    directions = few_bits(random, RAYS, 9)
    moving = (directions != 0).any(axis=1)
    assert_all_exact(vertices, faces, origins[moving], directions[moving])


@pytest.mark.slow
def test_half_a_million_rays_on_slivers_are_exact() -> None:
    random = np.random.default_rng(42)
    vertices, faces = thin_integers(random, 150)
    corners = vertices[faces[random.integers(len(faces), size=RAYS)]]
    targets = np.rint(corners[:, 0] + random.random((RAYS, 1)) * (corners[:, 1] - corners[:, 0]))
    directions = np.clip(few_bits(random, RAYS, 16), -REACH, REACH)
    origins = np.clip(targets - directions, -REACH, REACH).astype(np.float32)
    moving = (directions != 0).any(axis=1)
    assert_all_exact(vertices, faces, origins[moving], directions[moving])
