"""closest_hit and any_hit in users' own kernels, with Warp's default options, answer as the C++ core."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import random_rays, soup
from support.warp_launches import INFINITE, ZERO, Answers, assert_bit_identical, cpu_answers

from wive import _cpu, warp_kernels

pytestmark = pytest.mark.timeout(120)


HANDLES = {"watertight": warp_kernels.Bvh, "fast": warp_kernels.FastBvh, "exact": warp_kernels.ExactBvh}


def make_kernels(handle: type) -> tuple[wp.Kernel, wp.Kernel]:
    """A user's kernels for one type of handle."""

    @wp.kernel(module="unique")
    def trace(
        bvh: handle,
        origins: wp.array(dtype=wp.vec3),
        directions: wp.array(dtype=wp.vec3),
        hits: wp.array(dtype=warp_kernels.Hit),
        occluded: wp.array(dtype=wp.bool),
    ):
        i = wp.tid()
        hits[i] = warp_kernels.closest_hit(bvh, origins[i], directions[i], 0.0, wp.inf)
        occluded[i] = warp_kernels.any_hit(bvh, origins[i], directions[i], 0.0, wp.inf)

    @wp.kernel(module="unique")
    def count(
        bvh: handle,
        origins: wp.array(dtype=wp.vec3),
        directions: wp.array(dtype=wp.vec3),
        counts: wp.array(dtype=wp.int32),
    ):
        i = wp.tid()
        counts[i] = warp_kernels.count_hits(bvh, origins[i], directions[i], 0.25, 1.5)

    return trace, count


KERNELS = {accuracy: make_kernels(handle) for accuracy, handle in HANDLES.items()}
trace_watertight, _ = KERNELS["watertight"]


def trace(kernel: wp.Kernel, tree: warp_kernels.Tree, rays: tuple[np.ndarray, np.ndarray]) -> Answers:
    origins, directions = (wp.array(a, dtype=wp.vec3, device="cpu") for a in rays)
    hits = wp.zeros(len(origins), dtype=warp_kernels.Hit, device="cpu")
    occluded = wp.zeros(len(origins), dtype=wp.bool, device="cpu")
    wp.launch(kernel, len(origins), inputs=[tree.handle, origins, directions, hits, occluded], device="cpu")
    found = hits.numpy()
    uv = np.stack([found["u"], found["v"]], axis=1)
    none = np.zeros((len(found), 3), np.int32)
    return Answers(found["t"], found["prim"], uv, occluded.numpy(), *[none] * 8)


@pytest.mark.parametrize("accuracy", KERNELS)
def test_functions_in_a_users_kernel_give_the_bits_of_the_core(accuracy: str) -> None:
    bvh = _cpu.Bvh(*soup(3000, 1), accuracy)
    rays = random_rays(2000, 2, 0.0, 1.0)
    rays[1][::100] = 0
    tree = warp_kernels.upload(bvh, "cpu")
    found = trace(KERNELS[accuracy][0], tree, rays)
    warp_kernels.check(tree)
    assert_bit_identical(
        found, cpu_answers(bvh, "scalar", *rays, ZERO, INFINITE), ("t", "prim", "uv", "occluded")
    )


@pytest.mark.parametrize("accuracy", KERNELS)
def test_hits_counted_in_a_users_kernel_are_those_of_the_core(accuracy: str) -> None:
    bvh = _cpu.Bvh(*soup(3000, 1), accuracy)
    rays = random_rays(2000, 2, 0.0, 1.0)
    expected, _ = bvh.count("scalar", *rays, np.float32([0.25]), np.float32([1.5]))
    tree = warp_kernels.upload(bvh, "cpu")
    counts = wp.zeros(2000, dtype=wp.int32, device="cpu")
    vectors = [wp.array(a, dtype=wp.vec3, device="cpu") for a in rays]
    wp.launch(KERNELS[accuracy][1], 2000, inputs=[tree.handle, *vectors, counts], device="cpu")
    warp_kernels.check(tree)
    assert expected.max() > 5
    np.testing.assert_array_equal(counts.numpy(), expected)


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


def test_example_prints_a_tower_and_the_sky_it_hides() -> None:
    example = Path(__file__).resolve().parents[2] / "examples" / "ambient_occlusion.py"
    run = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, timeout=100)
    assert run.returncode == 0, run.stderr
    lines = [line for line in run.stdout.splitlines() if line]
    middle, corner = lines[-13], lines[-24]
    assert len(lines) >= 24
    assert middle[20:28] == " " * 8, "the tower itself"
    assert middle[18] not in " .", "the ground beside it sees less sky"
    assert set(corner[:4]) <= {" ", "."}, "the far corner sees nearly all"
