"""A Warp device that is full is a MemoryError, and the scene answers afterwards."""

import numpy as np
import pytest

wp = pytest.importorskip("warp")
from support.meshes import random_rays, sphere

import wive
from wive.warp_kernels.scene.memory import HIT_BYTES, expect_hits_fit, memory_errors

FULL = "Failed to allocate 48000000000 bytes on device 'cuda:0'"
QUERIES = ("intersect", "occluded", "count", "intersect_all")


@pytest.fixture
def full_device(monkeypatch):
    """Fills the device: what it is asked for from then on fails as Warp does."""

    def fill() -> None:
        def refuse(*arguments: object, **options: object) -> None:
            raise RuntimeError(FULL)

        monkeypatch.setattr(wp, "empty", refuse)
        monkeypatch.setattr(wp, "zeros", refuse)

    return fill


@pytest.mark.parametrize("query", QUERIES)
def test_queries_on_a_full_device(device, monkeypatch, full_device, query):
    scene = wive.Scene(*sphere(1), device=device)
    rays = random_rays(10, seed=1)
    expected = scene.count(*rays)
    full_device()
    with pytest.raises(MemoryError, match=f"^not enough memory: {FULL}$"):
        getattr(scene, query)(*rays)
    monkeypatch.undo()
    np.testing.assert_array_equal(scene.count(*rays), expected)


def test_results_on_a_full_device(device, full_device):
    scene = wive.Scene(*sphere(1), device=device)
    origins, directions = (wp.array(rays, dtype=wp.vec3, device=device) for rays in random_rays(10, seed=1))
    hits = scene.intersect(origins, directions)
    full_device()
    for compute in (hits.points, hits.normals, lambda: hits.mask, lambda: hits.error_bound):
        with pytest.raises(MemoryError, match=f"^not enough memory: {FULL}$"):
            compute()


@pytest.mark.parametrize("text", ["CUDA error 700", "Failed to allocate memory during graph capture because"])
def test_other_errors_of_a_device_stay_what_they_are(text):
    with pytest.raises(RuntimeError, match=text), memory_errors():
        raise RuntimeError(text)


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_hits_are_counted_before_they_are_allocated(precision):
    size = HIT_BYTES[precision]
    expect_hits_fit(1000, precision, "cuda:0", 1000 * size)
    with pytest.raises(
        MemoryError, match=r"^found 1001 hits, .* more than the limit of .*, or raise max_bytes$"
    ):
        expect_hits_fit(1001, precision, "cuda:0", 1000 * size)
    with pytest.raises(MemoryError, match=r"^found 10000000000 hits, "):
        expect_hits_fit(10**10, precision, "cpu", 0)
    with pytest.raises(MemoryError, match=r"more than a Warp array holds \(2147483647\)"):
        expect_hits_fit(2**31, precision, "cuda:0", 0)
