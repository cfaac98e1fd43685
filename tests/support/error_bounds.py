"""Easy and hard hits, and the exact t of each, for tests of `Hits.error_bound`."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np

import wive
from support.meshes import sphere

COUNT = 600
Set = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # vertices, faces, origins, directions


def aimed(
    corners: np.ndarray,
    random: np.random.Generator,
    distance: np.ndarray | float,
    direction: np.ndarray,
    dtype: type = np.float32,
) -> Set:
    """Rays at places in triangles (n,3,3), from `distance` behind along `direction` (n,3)."""
    corners = corners.astype(dtype)
    weights = random.dirichlet(np.ones(3), len(corners))
    targets = np.einsum("nk,nkx->nx", weights, corners.astype(np.float64))
    origins = (targets - distance * direction).astype(dtype)
    directions = (targets - origins).astype(dtype)
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), origins, directions


def random_triangles(random: np.random.Generator, count: int = COUNT) -> tuple[np.ndarray, np.ndarray]:
    return random.standard_normal((count, 3, 3)), random.standard_normal((count, 3))


def well_conditioned(dtype: type = np.float32) -> Set:
    vertices, faces = sphere(3)
    targets = np.random.default_rng(1).permutation(vertices[faces].mean(axis=1))[:COUNT]
    origins = (0.3 * np.random.default_rng(2).uniform(-1, 1, targets.shape)).astype(dtype)
    return vertices.astype(dtype), faces, origins, targets - origins


def slivers(dtype: type = np.float32) -> Set:
    random = np.random.default_rng(3)
    corners, direction = random_triangles(random)
    width = 10.0 ** random.uniform(-7, -2, (COUNT, 1))
    corners[:, 2] = (corners[:, 0] + corners[:, 1]) / 2 + width * corners[:, 2]
    return aimed(corners, random, 3.0, direction, dtype)


def grazing(dtype: type = np.float32) -> Set:
    random = np.random.default_rng(4)
    corners, _ = random_triangles(random)
    slope = 10.0 ** random.uniform(-8, -3, (COUNT, 1))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = (
        corners[:, 2] - corners[:, 0] + random.standard_normal((COUNT, 1)) * (corners[:, 1] - corners[:, 0])
    )
    return aimed(corners, random, 1.5, along + slope * normal, dtype)


def far_away(dtype: type = np.float32) -> Set:
    random = np.random.default_rng(5)
    corners, direction = random_triangles(random)
    place = np.array([148376.0, 1234.0, -223423.0])
    return aimed(corners + place, random, 10.0 ** random.uniform(-1, 5, (COUNT, 1)), direction, dtype)


def all_scales(dtype: type = np.float32) -> Set:
    random = np.random.default_rng(6)
    corners, direction = random_triangles(random)
    scale = 10.0 ** random.uniform(-6, 6, (COUNT, 1))
    return aimed(corners * scale[:, None], random, scale, direction, dtype)


def directions_of_all_lengths(dtype: type = np.float32) -> Set:
    random = np.random.default_rng(7)
    vertices, faces, origins, directions = well_conditioned(dtype)
    lengths = 10.0 ** random.uniform(-37, 37, (len(directions), 1))
    return vertices, faces, origins, (directions * lengths).astype(dtype)


def edges_and_vertices(dtype: type = np.float32) -> Set:
    """Rays at edges and vertices, many of which only hit triangles whose corners are rounded."""
    random = np.random.default_rng(8)
    vertices, faces = sphere(4, radius=1000.0)
    vertices = (vertices + np.array([148376.0, 1234.0, -223423.0])).astype(dtype)
    chosen = vertices[faces[random.integers(len(faces), size=COUNT)]].astype(np.float64)
    weight = random.random((COUNT, 1)) * random.integers(2, size=(COUNT, 1))
    middle = vertices.mean(axis=0, dtype=np.float64) + 300 * random.standard_normal((COUNT, 3))
    origins = middle.astype(dtype)
    return vertices, faces, origins, chosen[:, 0] * (1 - weight) + chosen[:, 1] * weight - origins


SETS = (
    well_conditioned,
    slivers,
    grazing,
    far_away,
    all_scales,
    directions_of_all_lengths,
    edges_and_vertices,
)


def traced(
    make: Callable[..., Set], accuracy: str, backend: str = "auto", dtype: type = np.float32
) -> tuple[wive.Hits, np.ndarray]:
    """Hits of a set and the exact t of each that hit, in Fractions."""
    vertices, faces, origins, directions = make(dtype)
    directions = directions.astype(dtype)
    hits = wive.Scene(vertices, faces, accuracy=accuracy, backend=backend).intersect(origins, directions)
    assert hits.mask.sum() > COUNT / 2
    return hits, exact_t(hits, origins, directions)


def fractions(array: np.ndarray) -> np.ndarray:
    return np.frompyfunc(lambda x: Fraction(float(x)), 1, 1)(array)


def crossed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack([a[:, i - 2] * b[:, i - 1] - a[:, i - 1] * b[:, i - 2] for i in range(3)], axis=1)


def crossed_sizes(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The cross product with every term taken positive: bounds the rounding of the cross product."""
    a, b = abs(a), abs(b)
    return np.stack([a[:, i - 2] * b[:, i - 1] + a[:, i - 1] * b[:, i - 2] for i in range(3)], axis=1)


def exact_t(hits: wive.Hits, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """t at which each line meets the plane of the triangle hit; None if the line is in the plane."""
    v0, v1, v2 = fractions(hits.vertices[hits.faces[hits.prim[hits.mask]]]).swapaxes(0, 1)
    normal = crossed(v1 - v0, v2 - v0)
    height = (normal * (v0 - fractions(origins[hits.mask]))).sum(axis=1)
    slope = (normal * fractions(directions[hits.mask])).sum(axis=1)
    return np.array([h / s if s else None for h, s in zip(height, slope, strict=True)], object)


def broken(hits: wive.Hits, exact: np.ndarray, bounds: np.ndarray) -> int:
    """The number of hits whose t is farther from the exact t than their bound (n,)."""
    count = 0
    for t, truth, bound in zip(hits.t[hits.mask], exact, bounds[hits.mask], strict=True):
        assert not np.isnan(bound)
        if np.isfinite(bound):
            count += truth is None or abs(Fraction(float(t)) - truth) > Fraction(float(bound))
    return count
