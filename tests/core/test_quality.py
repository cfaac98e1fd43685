"""quality="high" makes a better tree over the same triangles, and gives the same hits."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.meshes import assert_same_hits, random_rays, soup, sphere

import wive
from wive import _cpu

Mesh = tuple[np.ndarray, np.ndarray]


def sticks(count: int, seed: int) -> Mesh:
    """Long thin triangles in every direction among small ones, which binning by centroids separates badly."""
    random = np.random.default_rng(seed)
    middle, length = random.random((count, 1, 3)), random.pareto(1.5, (count, 1, 1)) * 0.02
    along, across = random.standard_normal((2, count, 1, 3))
    corners = middle + length * np.concatenate([-along, along, along + 0.1 * across], axis=1)
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def steps(mesh: Mesh, quality: str, rays: tuple[np.ndarray, np.ndarray]) -> float:
    """Mean number of inner nodes and triangle blocks that a ray visits."""
    _, stats = wive.Scene(*mesh, quality=quality).intersect(*rays, stats=True)
    return float(np.mean(stats.inner_nodes + stats.triangles / 4))


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
@pytest.mark.parametrize(
    "mesh", [sphere(4), soup(3000, seed=1), sticks(3000, seed=2)], ids=["sphere", "soup", "sticks"]
)
def test_hits_are_those_of_the_usual_tree_bit_for_bit(backend: str, mesh: Mesh, accuracy: str) -> None:
    medium, high = (
        wive.Scene(*mesh, backend=backend, accuracy=accuracy, quality=quality)
        for quality in ("medium", "high")
    )
    rays = random_rays(4000, seed=3)
    assert_same_hits(high.intersect(*rays), medium.intersect(*rays))
    np.testing.assert_array_equal(high.occluded(*rays), medium.occluded(*rays))


def test_rays_take_a_tenth_fewer_steps_among_triangles_of_every_size() -> None:
    mesh, rays = sticks(20_000, seed=4), random_rays(4000, seed=5, low=0, high=1)
    assert steps(mesh, "high", rays) < 0.9 * steps(mesh, "medium", rays)


@pytest.mark.parametrize(
    ("name", "ratio"), [("staircase", 0.9), ("living_room", 0.95), ("bathroom_salledebain", 0.9)]
)
def test_rays_take_fewer_steps_through_a_scene(
    scenes: Callable[[str], Mesh], name: str, ratio: float
) -> None:
    mesh = scenes(name)
    random = np.random.default_rng(6)
    start, end = random.uniform(mesh[0].min(axis=0), mesh[0].max(axis=0), (2, 4000, 3)).astype(np.float32)
    assert steps(mesh, "high", (start, end - start)) < ratio * steps(mesh, "medium", (start, end - start))


def test_surface_area_cost_falls() -> None:
    mesh = sticks(5000, seed=7)
    medium, high = (sum(_cpu.Bvh(*mesh, quality=quality).sah) for quality in ("medium", "high"))
    assert high < 0.95 * medium


@pytest.mark.parametrize("count", [0, 1, 4, 5, 8, 9, 17])
def test_the_smallest_meshes_are_built(count: int) -> None:
    mesh = soup(count, seed=count)
    prims = _cpu.Bvh(*mesh, quality="high").blocks[:, 9].view(np.int32)
    assert sorted(prims[prims >= 0]) == list(range(count))


def test_the_largest_coordinates_make_a_sound_tree() -> None:
    vertices = np.random.default_rng(8).uniform(-9.9e17, 9.9e17, (6000, 3)).astype(np.float32)
    bvh = _cpu.Bvh(vertices, np.arange(6000, dtype=np.int32).reshape(-1, 3), quality="high")
    prims = bvh.blocks[:, 9].view(np.int32)
    assert sorted(prims[prims >= 0]) == list(range(2000))


def test_a_saved_scene_keeps_its_quality(tmp_path: Path) -> None:
    mesh = sticks(2000, seed=9)
    wive.Scene(*mesh, quality="high").save(tmp_path / "scene.npz")
    loaded = wive.load(tmp_path / "scene.npz")
    assert np.array_equal(loaded._bvh.units, _cpu.Bvh(*mesh, quality="high").units)


def test_an_unknown_quality_is_refused() -> None:
    with pytest.raises(ValueError, match="quality must be one of medium, high"):
        wive.Scene(*sphere(1), quality="low")


def test_the_search_is_bounded_among_long_triangles(tmp_path: Path) -> None:
    """Long boxes overlap everywhere and bound no search: it would take the square of their number."""
    code = """
import numpy as np
from wive import _cpu
random, n = np.random.default_rng(8), 150_000
short = random.random((n, 3, 3)) * 0.001 + random.random((n, 1, 3))
corners = np.concatenate([short, (random.random((n, 3, 3)) - 0.5) * 10 + 0.5]).astype(np.float32)
_cpu.Bvh(corners.reshape(-1, 3), np.arange(6 * n, dtype=np.int32).reshape(-1, 3), quality="high")
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60, cwd=tmp_path)
