"""A ray traced alone gives the hits that it gives in a batch, whatever rays were traced before."""

import numpy as np
import pytest

import wive
from wive import _cpu


@pytest.mark.parametrize("kernel", [name for name, reason in _cpu.kernels().items() if not reason])
def test_a_ray_alone_with_a_finite_tmax_finds_what_it_finds_in_flight(kernel: str) -> None:
    random = np.random.default_rng(1)
    corners = random.uniform(-1, 1, (1000, 1, 3)) + 0.1 * random.standard_normal((1000, 3, 3))
    origins = random.uniform(-1.5, 1.5, (3000, 3)).astype(np.float32)
    directions = random.standard_normal((3000, 3)).astype(np.float32)
    limits = np.float32([0.1]), np.float32([2.0])
    faces = np.arange(3000, dtype=np.int32).reshape(-1, 3)
    bvh = _cpu.Bvh(corners.reshape(-1, 3).astype(np.float32), faces)
    alone, among_others = (
        bvh.intersect(kernel, origins, directions, *limits, in_flight=n)[:3] for n in (1, 24)
    )
    for a, b in zip(alone, among_others, strict=True):
        assert np.array_equal(a, b, equal_nan=True)
    if kernel != "avx512.half":  # which does not count
        counts = [
            bvh.intersect(kernel, origins, directions, *limits, in_flight=n, stats=True)[3] for n in (1, 24)
        ]
        assert np.array_equal(*counts)
    assert (alone[1] >= 0).mean() > 0.2


def test_one_ray_at_a_time_finds_what_the_batch_finds(backend: str) -> None:
    random = np.random.default_rng(2)
    corners = random.uniform(-1, 1, (1000, 1, 3)) + 0.1 * random.standard_normal((1000, 3, 3))
    faces = np.arange(3000, dtype=np.int32).reshape(-1, 3)
    scene = wive.Scene(corners.reshape(-1, 3).astype(np.float32), faces, backend=backend)
    origins, directions = random.uniform(-1.5, 1.5, (200, 3)), random.standard_normal((200, 3))
    batch = scene.intersect(origins, directions, tmin=0.1, tmax=2.0)
    alone = [
        scene.intersect(o[None], d[None], tmin=0.1, tmax=2.0)
        for o, d in zip(origins, directions, strict=True)
    ]
    assert np.array_equal(batch.prim, [hit.prim[0] for hit in alone])
