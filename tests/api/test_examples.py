"""The programs in examples/ run, and their functions agree with what they compute, by brute force."""

import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import wive

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ROWS, COLUMNS = 9, 8


def printed_by(name: str, folder: Path) -> str:
    """What an example prints; it must not warn."""
    command = [sys.executable, "-W", "error", str(EXAMPLES / f"{name}.py")]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=100, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_walls_of_a_casing_are_as_thick_as_it_was_made(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    numbers = map(float, re.findall(r"\d+\.?\d*", printed_by("wall_thickness", tmp_path)))
    thinnest, _, share, by_points, by_theorem = numbers
    outer, cavity = 2 * (40 * 30 + 30 * 20 + 20 * 40), 2 * (32 * 22 + 22 * 12 + 12 * 32)
    thin = 2 * (32 * 22 + 22 * 12)  # two walls of 2, seen from either side
    assert thinnest == 2
    assert share == pytest.approx(100 * thin / (outer + cavity), rel=0.02)
    assert by_theorem == 40 * 30 * 20 - 32 * 22 * 12
    assert by_points == pytest.approx(by_theorem, rel=0.005)


def test_a_lidar_sees_houses_on_both_sides_and_the_road(tmp_path):
    lines = printed_by("lidar", tmp_path).splitlines()
    assert set(lines[15]) == {"@"}, "the lowest beam meets the road nearby in all directions"
    assert set(lines[0]) >= {" ", "#"}, "the highest one meets houses, and the sky between them"
    assert "of 1536 rays returned" in lines[16]


def test_a_torus_is_seen_with_its_hole(tmp_path):
    lines = printed_by("depth_picture", tmp_path).splitlines()
    depth = lines[:30]
    middle = [row for row in depth if row.strip() and "  " in row.strip()]
    assert middle, "background within the torus"
    assert depth[0].strip() == depth[-1].strip() == "", "background above and below"
    assert "triangles seen" in lines[60]


def test_a_lookout_sees_some_land_and_a_valley_has_a_horizon(tmp_path):
    pytest.importorskip("matplotlib")
    text = printed_by("viewshed", tmp_path)
    assert text.count("^") == 1
    assert text.count("#") > 400
    assert text.count(".\n") > 10


@pytest.fixture(scope="module")
def recipes() -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(EXAMPLES / "viewshed.py")))


class Terrain:
    """Heights on a grid, and its edges, between which the surface is flat."""

    def __init__(self, seed: int, y_sign: int = 1) -> None:
        random = np.random.default_rng(seed)
        self.z = random.uniform(0, 3, (ROWS, COLUMNS)) ** 2
        self.x = np.cumsum(random.uniform(0.5, 2, COLUMNS)) + 500_000
        self.y = y_sign * (np.cumsum(random.uniform(0.5, 2, ROWS)) + 4_000_000)
        self.points = np.stack([*np.meshgrid(self.x, self.y), self.z], axis=-1)
        p = self.points
        pairs = (p[:, :-1], p[:, 1:]), (p[:-1], p[1:]), (p[:-1, :-1], p[1:, 1:])
        self.ends = np.concatenate([np.stack(pair, axis=-2).reshape(-1, 2, 3) for pair in pairs])
        self.scene = wive.Scene.from_heightfield(self.z, self.x, self.y)

    def on_ground(self, places: np.ndarray, above: float) -> np.ndarray:
        """The places (...,3) moved to so high above the surface."""
        high = np.concatenate([places[..., :2], np.full((*places.shape[:-1], 1), 100.0)], axis=-1)
        return self.scene.intersect(high, (0, 0, -1)).points() + np.array([0, 0, above])

    def crossed(self, a: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where, in steps, the line from `a` passes above edges, seen from above, and their heights there."""
        start, along = self.ends[:, 0], self.ends[:, 1] - self.ends[:, 0]
        across = step[0] * along[:, 1] - step[1] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            to = start - a
            s = (to[:, 0] * along[:, 1] - to[:, 1] * along[:, 0]) / across
            r = (to[:, 0] * step[1] - to[:, 1] * step[0]) / across
        met = (r >= 0) & (r <= 1) & (s > 0)
        return s[met], (start[:, 2] + r * along[:, 2])[met]

    def sees(self, a: np.ndarray, b: np.ndarray) -> tuple[bool, float]:
        """Whether a sees b, and how far from changing that is."""
        s, heights = self.crossed(a, b - a)
        clear = (a[2] + s * (b[2] - a[2]) - heights)[s < 1]
        return bool((clear > 0).all()), float(np.min(np.append(abs(clear), np.inf)))


@pytest.mark.parametrize("y_sign", [1, -1])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_viewshed_is_what_no_edge_of_the_terrain_hides(recipes, seed, y_sign):
    terrain = Terrain(seed, y_sign)
    eye = terrain.points[4, 3] + [0.2, 0.1 * y_sign, 4]
    found = recipes.viewshed(terrain.scene, eye, terrain.z.shape, above=0.5)
    for place in np.ndindex(terrain.z.shape):
        expected, clearance = terrain.sees(eye, terrain.points[place] + [0, 0, 0.5])
        assert clearance > 1e-6
        assert found[place] == expected
    assert 5 < np.count_nonzero(found) < found.size - 5


def test_a_viewshed_leaves_holes_out(recipes):
    terrain = Terrain(1)
    z = terrain.z.copy()
    z[2:4, 5] = np.nan
    scene = wive.Scene.from_heightfield(z, terrain.x, terrain.y)
    found = recipes.viewshed(scene, terrain.points[4, 3] + [0, 0, 100], z.shape, above=0.5)
    np.testing.assert_array_equal(found, np.isfinite(z))


def test_places_see_each_other_if_no_edge_is_between(recipes):
    terrain = Terrain(3)
    random = np.random.default_rng(4)
    low, high = terrain.points.reshape(-1, 3).min(axis=0), terrain.points.reshape(-1, 3).max(axis=0)
    a, b = random.uniform(low, high, (2, 10, 20, 3))
    a, b = terrain.on_ground(a, 0.3), terrain.on_ground(b, 0.3)
    found = recipes.sees(terrain.scene, a, b)
    assert 20 < np.count_nonzero(found) < 180
    for place in np.ndindex(10, 20):
        expected, clearance = terrain.sees(a[place], b[place])
        assert clearance > 1e-6
        assert found[place] == expected


def test_horizons_are_the_highest_edges_in_each_direction(recipes):
    terrain = Terrain(5)
    places = terrain.on_ground(terrain.points[2:6:3, 2:6:3] + np.array([0.1, 0.2, 0]), 0.3)
    azimuths = np.arange(0.5, 360, 10)
    found = recipes.horizon(terrain.scene, places, azimuths)
    assert found.shape == (2, 2, 36)
    for place in np.ndindex(2, 2):
        for i, azimuth in enumerate(np.radians(azimuths)):
            s, heights = terrain.crossed(places[place], np.array([np.sin(azimuth), np.cos(azimuth)]))
            expected = np.degrees(np.arctan2(heights - places[place][2], s)).max()
            assert found[(*place, i)] == pytest.approx(expected, abs=1e-5)


def test_the_sky_view_factor_is_that_of_a_wall_and_of_a_basin(recipes):
    assert recipes.sky_view(np.array([-3.0] * 8)) == 1
    assert recipes.sky_view(np.array([90.0, 90, 0, 0])) == pytest.approx(0.5)
    # Light of a uniform sky on level ground, by integration over the sky above a horizon of 30 degrees.
    elevations = np.radians(np.linspace(30, 90, 10_001))
    integrand = np.sin(elevations) * np.cos(elevations)
    integral = 2 * np.mean((integrand[1:] + integrand[:-1]) / 2) * np.radians(60)
    assert recipes.sky_view(np.full(36, 30.0)) == pytest.approx(integral, rel=1e-6)
