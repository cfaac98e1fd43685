"""Rays that miss the box of the whole tree are dropped early: none of them hits anything."""

import numpy as np
import pytest
from support.meshes import soup

from wive import _cpu

KERNELS = [name for name, reason in _cpu.kernels().items() if not reason]
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
SIDES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                  [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int32)  # fmt: skip


def rays_around(
    random: np.random.Generator, distance: float, count: int = 6000
) -> tuple[np.ndarray, np.ndarray]:
    """Rays from around the cube; a third just meet or miss its corners, edges and sides."""
    origins = random.standard_normal((count, 3))
    origins *= distance / np.linalg.norm(origins, axis=1, keepdims=True)
    aims = random.uniform(-1, 1, (count, 3))
    fixed = random.random((count, 3)) < 0.6
    aims[fixed] = np.sign(aims[fixed])
    directions = aims - origins
    from_inside = random.random(count) < 0.1
    origins[from_inside] = aims[from_inside]
    wild = random.random(count) < 0.6
    directions[wild] = random.standard_normal((int(wild.sum()), 3))
    beside = random.random(count) < 0.2  # in the plane of a side, along an axis or nearly
    axis = random.integers(3, size=count)
    origins[beside, axis[beside]] = np.sign(origins[beside, axis[beside]])
    directions[beside, axis[beside]] *= random.choice([0.0, -0.0, 1e-30, 1e-8], int(beside.sum()))
    return origins, directions


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("scale", [1.0, 1e-30, 1e-12, 1e9, 1e16])
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_no_ray_that_hits_is_dropped(kernel: str, dtype: type, scale: float, nodes: str) -> None:
    if kernel == "avx512.half" and (dtype is np.float64 or nodes == "compressed"):
        pytest.skip("the half form has float32 nodes and numbers only")
    random = np.random.default_rng(72)
    inner, faces = soup(200, 5)
    vertices = (np.vstack([CORNERS, inner * 0.5]) * scale).astype(dtype)
    solid = np.vstack([SIDES, faces + 8]).astype(np.int32)
    bvh, plain = _cpu.Bvh(vertices, solid, nodes=nodes), _cpu.Bvh(vertices, solid)
    hit = 0
    for distance, length, tmin in ((1.5, 1.0, 0.0), (3.0, 1e-10, -10.0), (100.0, 1e6, 0.0), (1e6, 1.0, 0.0)):
        origins, directions = rays_around(random, distance)
        rays = (origins * scale).astype(dtype), (directions * (scale * length)).astype(dtype)
        limits = np.array([tmin / length], dtype), np.array([np.inf], dtype)
        undropped = plain.intersect(kernel, *rays, *limits, in_flight=1)[:3]
        for n in (1, 24):
            for a, b in zip(undropped, bvh.intersect(kernel, *rays, *limits, in_flight=n)[:3], strict=True):
                assert np.array_equal(a, b, equal_nan=True)
            occluded, _ = bvh.occluded(kernel, *rays, *limits, in_flight=n)
            assert np.array_equal(occluded, undropped[1] >= 0)
        hit += int((undropped[1] >= 0).sum())
    assert hit > 3000


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_no_ray_at_a_mesh_of_subnormal_size_is_dropped(kernel: str, nodes: str) -> None:
    if kernel == "avx512.half":
        pytest.skip("the half form has float32 nodes and numbers only")
    vertices = np.array([[7.0, -5, 1], [7, 6.5, -9.5], [7, 11, -0.5]]) * 1e-45
    bvh = _cpu.Bvh(vertices, np.array([[0, 1, 2]], np.int32), nodes=nodes)
    origins = np.tile(vertices.mean(axis=0), (64, 1))
    directions = np.random.default_rng(3).standard_normal((64, 3)) * [1e7, 1e-38, 1e18]
    limits = np.array([-np.inf]), np.array([np.inf])
    alone, in_flight = (bvh.intersect(kernel, origins, directions, *limits, in_flight=n)[1] for n in (1, 24))
    assert np.array_equal(alone, in_flight)
    assert (alone >= 0).sum() > 32
