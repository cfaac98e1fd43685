"""Triangles of any size and place, hits in them, and rays spawned from these hits."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np

import wive
from support.error_bounds import aimed, crossed, fractions

COUNT = 200
# Magnitude of coordinates, size of triangles, and how far off the middle of an edge the third corner is.
EXPONENTS = [(10.0**e, 10.0**e, 1.0) for e in range(-6, 7)]
TRANSLATED = [(10.0**e, 10.0 ** (e - shift), 1.0) for e in (-5, 0, 6) for shift in (1, 2, 4)]
SLIVERS = [(1.0, 1.0, 1e-3), (1.0, 1.0, 1e-4), (100.0, 1.0, 1e-3)]


def triangles(magnitude: float, size: float, width: float, seed: int = 1) -> np.ndarray:
    """(n,3,3) corners around a place of that magnitude."""
    random = np.random.default_rng(seed)
    corners = size * random.uniform(0.01, 1, (COUNT, 1, 1)) * random.standard_normal((COUNT, 3, 3))
    if width < 1:
        corners[:, 2] = (corners[:, 0] + corners[:, 1]) / 2 + width * corners[:, 2]
    if size < magnitude:
        corners += magnitude * random.uniform(0.5, 1, 3) * [1, -1, 1]
    return corners


def hits_of(
    corners: np.ndarray, accuracy: str, slope: float = 1.0, dtype: type = np.float32
) -> tuple[wive.Scene, wive.Hits, np.ndarray]:
    """A scene of these triangles, hits in it that rays were aimed at, and the directions of these rays."""
    random = np.random.default_rng(2)
    size = abs(corners - corners.mean(axis=1, keepdims=True)).max(axis=(1, 2))[:, None]
    direction = random.standard_normal((len(corners), 3))
    direction -= (1 - slope) * project(direction, corners)
    vertices, faces, origins, directions = aimed(corners, random, 2 * size, direction, dtype)
    scene = wive.Scene(vertices, faces, accuracy=accuracy)
    return scene, scene.intersect(origins, directions), directions


def project(directions: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The components of directions along the normals of triangles (n,3,3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return (directions * normals).sum(axis=1, keepdims=True) * normals


def ways_out(hits: wive.Hits, incoming: np.ndarray, flattest: float = 1e-9) -> np.ndarray:
    """(k,n,3) directions: straight on, reflected, random on both sides, and at slopes down to `flattest`."""
    random = np.random.default_rng(3)
    normals = np.where(hits.mask[:, None], hits.normals(), [0, 0, 1])
    incoming = incoming / np.linalg.norm(incoming, axis=1, keepdims=True)
    along = 2 * (incoming * normals).sum(axis=1, keepdims=True) * normals
    anywhere = random.standard_normal((6, len(normals), 3))
    in_plane = anywhere[:3] - (anywhere[:3] * normals).sum(axis=-1, keepdims=True) * normals
    slopes = 10 ** random.uniform(np.log10(flattest), -2, (3, len(normals), 1)) * random.choice(
        [-1, 1], (3, len(normals), 1)
    )
    # and along the edges, for which the direction is in the plane as precisely as its dtype allows
    corners = hits.vertices[hits.faces[np.maximum(hits.prim, 0)]].astype(np.float64)
    edges = (corners - np.roll(corners, 1, axis=1)).swapaxes(0, 1)
    edges /= abs(edges).max(axis=-1, keepdims=True)
    ways = [[incoming, incoming - along, -incoming], anywhere, in_plane + slopes * normals, edges, -edges]
    return np.concatenate([np.asarray(way) for way in ways]).astype(hits.t.dtype)


def own_hits(
    scene: wive.Scene,
    hits: wive.Hits,
    incoming: np.ndarray,
    flattest: float = 1e-9,
    spawn: Callable[[np.ndarray], np.ndarray] | None = None,
) -> int:
    """The number of rays that hit the triangle they left, from the origins of `spawn`, or of hits.spawn."""
    count = 0
    for directions in ways_out(hits, incoming, flattest):
        again = scene.intersect_all((spawn or hits.spawn)(directions), directions, touching=True)
        count += np.count_nonzero(again.prim == hits.prim[again.ray])
    return count


def assert_origins_on_the_side(hits: wive.Hits, ways: np.ndarray) -> None:
    """Spawned origins lie, exactly and strictly, on the side of the plane to which each direction leads."""
    found = np.flatnonzero(hits.mask)
    v0, v1, v2 = fractions(hits.vertices[hits.faces[hits.prim[found]]]).swapaxes(0, 1)
    normal = crossed(v1 - v0, v2 - v0)
    for directions in ways:
        above = (normal * (fractions(hits.spawn(directions)[found]) - v0)).sum(axis=1)
        forward = (normal * fractions(directions[found])).sum(axis=1)
        assert all(a * f > Fraction(0) for a, f in zip(above, forward, strict=True))


def leave(scene: wive.Scene, origin: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Whether 120,000 rays spawned outwards, a quarter of them grazing, and as many inwards hit anything."""
    random = np.random.default_rng(seed)
    hits = scene.intersect(origin.astype(np.float32), random.standard_normal((120_000, 3)).astype(np.float32))
    normals = hits.normals()
    assert hits.mask.all()
    directions = random.standard_normal(normals.shape)
    directions[::4] -= (1 - 1e-4) * (directions[::4] * normals[::4]).sum(axis=1, keepdims=True) * normals[::4]
    directions = directions.astype(np.float32)
    outwards = np.where((directions * normals).sum(axis=1, keepdims=True) < 0, -directions, directions)
    return scene.occluded(hits.spawn(outwards), outwards), scene.occluded(hits.spawn(-outwards), -outwards)
