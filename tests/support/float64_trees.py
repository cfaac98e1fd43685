"""float64 trees of the compiled core, queries of them, and brute force in rational numbers."""

import functools
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from support.meshes import sphere
from wive import _cpu

Mesh = tuple[np.ndarray, np.ndarray]
Closest = tuple[np.ndarray, np.ndarray, np.ndarray]

NODES = ("float32", "compressed")
ACCURACIES = ("fast", "watertight")
UTM = (500000.123, 4649776.5, 312.7)
PLACES = [(0.0, 0.0, 0.0), UTM, (-3e9, 2e9, 1e9), (1e15, 0.0, -1e15)]


def kernels() -> list[str]:
    """The kernels of float64 trees that this machine can run."""
    usable = _cpu.kernels()
    return [name for name in ("avx512", "avx2", "scalar") if not usable[name]]


each_kernel = pytest.mark.parametrize("kernel", kernels())
each_form = pytest.mark.parametrize("nodes", NODES)


unit_sphere = functools.cache(sphere)


def sphere64(level: int, radius: float = 1.0, place: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Mesh:
    """A closed sphere whose coordinates are no float32 numbers."""
    vertices, faces = unit_sphere(level)
    return vertices.astype(np.float64) * radius + np.asarray(place), faces


def soup(triangles: int, size: float, random: np.random.Generator) -> Mesh:
    """Triangles of that size, strewn over a cube from -1 to 1."""
    middles = random.uniform(-1, 1, (triangles, 1, 3))
    vertices = (middles + size * random.standard_normal((triangles, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3)


def leaving(mesh: Mesh, kind: str, count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Rays from inside a closed mesh at its vertices, points of its edges, or into its faces."""
    vertices, faces = mesh
    corners = vertices[faces[random.integers(len(faces), size=count)]]
    weight = random.random((count, 1))
    targets = {
        "vertices": corners[:, 0],
        "edges": corners[:, 0] * weight + corners[:, 1] * (1 - weight),
        "faces": corners.mean(axis=1),
    }[kind]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    origins = (low + high) / 2 + 0.2 * (high - low) * random.uniform(-1, 1, targets.shape)
    return origins, targets - origins


def query(
    bvh: _cpu.Bvh,
    kernel: str,
    name: str,
    origins: np.ndarray,
    directions: np.ndarray,
    tmin: Any = 0.0,
    tmax: Any = np.inf,
    **options: Any,
) -> Any:
    limits = [np.atleast_1d(np.asarray(limit, origins.dtype)) for limit in (tmin, tmax)]
    return getattr(bvh, name)(kernel, origins, directions, *limits, **options)


def closest(
    bvh: _cpu.Bvh, kernel: str, origins: np.ndarray, directions: np.ndarray, **options: Any
) -> Closest:
    """t (n,), prim (n,) and uv (n,2)."""
    t, prim, uv, _ = query(bvh, kernel, "intersect", origins, directions, **options)
    return t, prim, uv


def hits_it(bvh: _cpu.Bvh, kernel: str, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Whether the closest-hit and the any-hit query hit; both must agree."""
    found = closest(bvh, kernel, origins, directions)[1] >= 0
    assert np.array_equal(found, query(bvh, kernel, "occluded", origins, directions)[0])
    return found


def fractions(values: np.ndarray) -> np.ndarray:
    return np.frompyfunc(Fraction, 1, 1)(values)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack(
        [a[..., i - 2] * b[..., i - 1] - a[..., i - 1] * b[..., i - 2] for i in range(3)], axis=-1
    )


def exact_hits(mesh: Mesh, origin: np.ndarray, direction: np.ndarray) -> list[tuple[Fraction, int, Fraction]]:
    """t, number and least of the three normalised weights, of each triangle that the exact line meets."""
    corners = fractions(mesh[0])[mesh[1]]
    o, d = fractions(origin), fractions(direction)
    away = corners - o
    weights = np.stack(
        [(d * cross(away[:, (k + 1) % 3], away[:, (k + 2) % 3])).sum(axis=-1) for k in range(3)], axis=-1
    )
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    hits = []
    for face, weight in enumerate(weights):
        total = weight.sum()
        if total == 0 or min(weight / total) < 0:
            continue
        t = (normal[face] * away[face, 0]).sum() / (normal[face] * d).sum()
        hits.append((t, face, min(weight / total)))
    return sorted(hits)
