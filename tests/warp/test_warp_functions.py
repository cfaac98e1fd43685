"""closest_hit and any_hit in users' own kernels, with Warp's default options, answer as the C++ core."""

import functools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import random_rays, soup

from wive import _cpu, warp_kernels
from wive.hits import surface_normals
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.tree.handle import HANDLES, HITS

pytestmark = pytest.mark.timeout(120)


@functools.cache
def kernel_for(accuracy: str, precision: str) -> wp.Kernel:
    """A user's kernel that takes the handle of trees of this accuracy and precision."""
    numbers = PRECISIONS[precision]
    real, vec3 = numbers.real, numbers.vec3

    @wp.kernel(module="unique", enable_backward=False)
    def trace(
        bvh: HANDLES[accuracy, precision],
        origins: wp.array(dtype=vec3),
        directions: wp.array(dtype=vec3),
        hits: wp.array(dtype=HITS[precision]),
        occluded: wp.array(dtype=wp.bool),
        counts: wp.array(dtype=wp.int32),
    ):
        i = wp.tid()
        origin, direction = origins[i], directions[i]
        hits[i] = warp_kernels.closest_hit(bvh, origin, direction, real(0.0), real(wp.inf))
        occluded[i] = warp_kernels.any_hit(bvh, origin, direction, real(0.0), real(0.03))
        counts[i] = warp_kernels.count_hits(bvh, origin, direction, real(0.25), real(1.5))

    return trace


@pytest.mark.parametrize(("accuracy", "precision"), HANDLES)
def test_functions_in_a_users_kernel_give_the_bits_of_the_core(accuracy: str, precision: str) -> None:
    vertices, faces = soup(3000, 1)
    bvh = _cpu.Bvh(vertices.astype(precision), faces, accuracy)
    origins, directions = (rows.astype(precision) for rows in random_rays(2000, 2, 0.0, 1.0))
    origins[1::3] += 1e-9  # nothing that float32 holds
    directions[::100] = 0
    tree = warp_kernels.upload(bvh, "cpu")
    vec3 = PRECISIONS[precision].vec3
    rays = [wp.array(rows, dtype=vec3, device="cpu") for rows in (origins, directions)]
    outputs = [wp.zeros(2000, dtype=dtype, device="cpu") for dtype in (HITS[precision], wp.bool, wp.int32)]
    wp.launch(kernel_for(accuracy, precision), 2000, [tree.handle, *rays], outputs, device="cpu")
    warp_kernels.check(tree)
    hits, occluded, counts = (array.numpy() for array in outputs)

    def limits(*values: float) -> list[np.ndarray]:
        return [np.array([value], precision) for value in values]

    t, prim, uv, _ = bvh.intersect("scalar", origins, directions, *limits(0, np.inf))
    assert len(np.unique(prim)) > 500
    np.testing.assert_array_equal(hits["t"], t)
    np.testing.assert_array_equal(hits["prim"], prim)
    np.testing.assert_array_equal(np.stack([hits["u"], hits["v"]], axis=1), uv)
    expected_normals = surface_normals(bvh.vertices, faces, prim)
    tolerance = 1e-9 if precision == "float64" else 2e-4 if accuracy == "fast" else 1e-6  # fast: of edges
    np.testing.assert_allclose(
        hits["normal"], expected_normals, atol=tolerance if precision == "float32" else 1e-9
    )
    against = (expected_normals * directions).sum(axis=1)
    sure = (prim < 0) | (np.abs(against) > 1e-3)
    np.testing.assert_array_equal(hits["front"][sure], (against < 0)[sure])
    assert 0.2 < hits["front"].mean() < 0.8 and sure.mean() > 0.99
    expected, _ = bvh.occluded("scalar", origins, directions, *limits(0, 0.03))
    assert 0.2 < expected.mean() < 0.9
    np.testing.assert_array_equal(occluded, expected)
    expected, _ = bvh.count("scalar", origins, directions, *limits(0.25, 1.5))
    assert expected.max() > 5
    np.testing.assert_array_equal(counts, expected)


def test_functions_are_made_when_first_used(tmp_path: Path) -> None:
    code = """
import sys
from wive import warp_kernels
assert "wive.warp_kernels.functions.functions" not in sys.modules
assert {"closest_hit", "differentiable_hit"} <= set(dir(warp_kernels))
assert warp_kernels.closest_hit is warp_kernels.closest_hit
assert "wive.warp_kernels.functions.functions" in sys.modules
"""
    # Not in the source folder, whose wive has no compiled core.
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60, cwd=tmp_path)
    with pytest.raises(AttributeError, match="no attribute 'farthest_hit'"):
        _ = warp_kernels.farthest_hit
