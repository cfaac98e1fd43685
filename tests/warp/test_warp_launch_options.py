"""`lanes` and block sizes that no kernel runs with are refused, wherever they are given."""

import dataclasses
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import random_rays, soup, sphere

import wive
from wive import _cpu, warp_kernels
from wive.warp_kernels.lanes.lanes import lanes_of
from wive.warp_kernels.lanes.warps import collectives, warp_of
from wive.warp_kernels.launching.kernels import make_kernel
from wive.warp_kernels.launching.launch import (
    MOST_CPU_TURNS,
    MOST_CUDA_THREADS,
    MOST_TURNS,
    default_block_dim,
    threads_of,
    turns_of,
)
from wive.warp_kernels.scene.tracer import choose_lanes

pytestmark = pytest.mark.timeout(60)

# Each launch and how many arrays it takes.
LAUNCHES = [
    (warp_kernels.launch_closest, 7),
    (warp_kernels.launch_any, 5),
    (warp_kernels.launch_count, 5),
    (warp_kernels.launch_all, 9),
]
# What is neither 8 nor 1; True equals 1.
ODD_LANES = (4, 2, 0, -8, 16, 8.0, 1.5, True, "8", "auto ", None, [8], np.array([1, 8]))


def refusal(
    tree: warp_kernels.Tree, launch: Callable[..., None], arrays: int, options: dict[str, Any]
) -> str:
    array = wp.zeros(1, dtype=wp.vec3, device="cpu")
    with pytest.raises(ValueError) as error:
        launch(tree, *[array] * arrays, **options)
    return str(error.value)


@pytest.mark.parametrize(("launch", "arrays"), LAUNCHES)
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lanes": 1, "block_dim": 12}, "block_dim: expected a multiple of 8 with lanes=1, got 12"),
        ({"lanes": 8, "block_dim": 0}, "block_dim: expected 1 to 1024 threads, got 0"),
        ({"lanes": 1, "block_dim": -8}, "block_dim: expected 1 to 1024 threads, got -8"),
        ({"lanes": 8, "block_dim": 1032}, "block_dim: expected 1 to 1024 threads, got 1032"),
        ({"block_dim": 64.0}, "block_dim: expected 1 to 1024 threads, got 64.0"),
        ({"block_dim": True}, "block_dim: expected 1 to 1024 threads, got True"),
        ({"block_dim": "64"}, "block_dim: expected 1 to 1024 threads, got '64'"),
    ]
    + [({"lanes": lanes}, f"lanes: expected 8 or 1, got {lanes!r}") for lanes in ODD_LANES],
)
def test_launches_refuse_lanes_and_block_sizes_out_of_range(
    launch: Callable[..., None], arrays: int, options: dict[str, Any], message: str
) -> None:
    tree = warp_kernels.upload(_cpu.Bvh(*sphere(1)), "cpu")
    assert refusal(tree, launch, arrays, options) == message


@pytest.mark.parametrize(("launch", "arrays"), LAUNCHES)
@pytest.mark.parametrize("precision", MOST_CUDA_THREADS)
def test_launches_on_cuda_refuse_blocks_for_which_there_is_no_room(
    launch: Callable[..., None], arrays: int, precision: str
) -> None:
    vertices, faces = sphere(1)
    tree = warp_kernels.upload(_cpu.Bvh(vertices.astype(precision), faces), "cpu")
    tree = dataclasses.replace(tree, device=SimpleNamespace(is_cuda=True, is_cpu=False))
    most = MOST_CUDA_THREADS[precision]
    message = (
        f"block_dim: {most + 8} threads have no room in a block's registers; "
        f"use at most {most} in a {precision} tree"
    )
    assert refusal(tree, launch, arrays, {"block_dim": most + 8}) == message
    deep = dataclasses.replace(tree, stack=512)
    message = "block_dim: 96 threads have no room for their stacks in 48 KiB; use fewer"
    assert refusal(deep, launch, arrays, {"block_dim": 96, "lanes": 1}) == message


@pytest.mark.parametrize("query", ["intersect", "occluded", "count", "intersect_all"])
@pytest.mark.parametrize("lanes", ODD_LANES)
def test_queries_refuse_lanes_other_than_8_and_1(query: str, lanes: Any) -> None:
    scene = wive.Scene(*sphere(1), device="cpu")
    with pytest.raises(ValueError, match="lanes must be one of auto, 8, 1, got "):
        getattr(scene, query)([0, 0, 0], [0, 0, 1], lanes=lanes)


MADE_FOR_LANES = {
    "kernel": lambda lanes: make_kernel("closest", "watertight", lanes, 32),
    "collectives": collectives,
    "warps": warp_of,
    "vectors": lambda lanes: lanes_of(lanes, 32, "float32"),
    "block size": default_block_dim,
    "choice": lambda lanes: choose_lanes(lanes, 1, False),
}


@pytest.mark.parametrize("made", MADE_FOR_LANES)
@pytest.mark.parametrize("lanes", [4, 2, 0, -8, 16, 1.5, "8"])
def test_nothing_is_made_for_lanes_other_than_8_and_1(made: str, lanes: Any) -> None:
    with pytest.raises(ValueError, match="lanes: expected 8 or 1, got "):
        MADE_FOR_LANES[made](lanes)


@pytest.mark.parametrize("number", [int, np.int32, np.uint8])
def test_lanes_and_block_sizes_may_be_numbers_of_numpy(number: type) -> None:
    bvh = _cpu.Bvh(*soup(100, 1))
    origins, directions = random_rays(20, 2, 0.0, 1.0)
    core = bvh.intersect("scalar", origins, directions, np.zeros(1, np.float32), np.ones(1, np.float32))
    rays = [wp.array(rows, dtype=wp.vec3, device="cpu") for rows in (origins, directions)]
    limits = [wp.full(1, value, dtype=wp.float32, device="cpu") for value in (0.0, 1.0)]
    t, prim = wp.zeros(20, dtype=wp.float32, device="cpu"), wp.zeros(20, dtype=wp.int32, device="cpu")
    tree = warp_kernels.upload(bvh, "cpu")
    warp_kernels.launch_closest(tree, *rays, *limits, t, prim, lanes=number(8), block_dim=number(64))
    np.testing.assert_array_equal(prim.numpy(), core[1])


@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize("block_dim", [8, 24, 64, 96, 128, 512])
def test_warps_of_a_launch_have_room_for_all_rays(lanes: Any, block_dim: int) -> None:
    gpu = SimpleNamespace(is_cuda=True, sm_count=132)
    for count in (1, 31, 33, 1000, 100_000, 1_000_003, 2**31 - 1):
        for device in (gpu, wp.get_device("cpu")):
            turns = turns_of(device, count)
            threads = threads_of(count, turns, lanes, block_dim)
            assert (
                1 <= turns <= (MOST_TURNS if device is gpu else MOST_CPU_TURNS) and threads % block_dim == 0
            )
            warps = threads // block_dim * -(-block_dim // 32) if device is gpu else threads * lanes // 8
            rays_at_once = 32 * lanes // 8 if device is gpu else 1
            assert warps * rays_at_once * turns >= count
    assert turns_of(gpu, 100_000) == 1  # rays are not made to wait while threads are idle
    assert turns_of(gpu, 10_000_000) == MOST_TURNS
