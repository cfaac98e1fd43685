"""Functions of the programs in examples/ about terrain agree with what they compute, by brute force."""

from types import ModuleType

import numpy as np
import pytest
from support.programs import example

import wive

pytest.importorskip("matplotlib")

ROWS, COLUMNS = 9, 8


@pytest.fixture(scope="module")
def recipes() -> ModuleType:
    return example("viewshed")


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


def test_the_sun_is_overhead_at_noon_on_the_equator_and_a_flat_land_has_twelve_hours_of_it(recipes):
    module = example("sun_hours")
    np.testing.assert_allclose(module.sun(12, 0, 0), (0, 0, 1), atol=1e-15)
    np.testing.assert_allclose(module.sun(6, 0.5, 0), (1, 0, 0), atol=1e-15)  # rises in the east
    assert module.sun(12, np.radians(50), 0)[1] < 0, "in the south at noon"
    flat = wive.Scene.from_heightfield(np.zeros((3, 3)), np.arange(3.0), np.arange(3.0))
    hours = module.sun_hours(flat, np.array([[1.0, 1, 0.5]]), np.radians(50), np.radians(1e-6))
    assert hours == pytest.approx(12, abs=module.STEP)
    walled = wive.Scene.from_heightfield(
        np.array([[0, 0, 0], [0, 0, 0], [99.0, 99, 99]]), np.linspace(-1e4, 1e4, 3), -np.arange(3.0)
    )
    assert module.sun_hours(walled, np.array([[1.0, 0, 0.5]]), np.radians(50), 0.0) < 1, "a wall in the south"


def test_a_plain_sees_all_of_the_sky_and_a_place_at_a_wall_half(recipes):
    module = example("sky_view")
    x = np.linspace(-50, 50, 101)
    z = np.where(x[:, None] < 0, 1e4, 0.0) * np.ones(101)
    scene = wive.Scene.from_heightfield(z, x, x)
    assert module.sky_view(scene, np.array([[0.0, 0.05, 0.01]])) == pytest.approx(0.5, abs=0.08)
    assert module.sky_view(wive.Scene.from_heightfield(0 * z, x, x), np.array([[0.0, 0, 1]])) == 1


def test_masts_see_each_other_unless_a_hill_is_between(recipes):
    module = example("line_of_sight")
    terrain = Terrain(7)
    tops = terrain.points[[1, 4, 7], [1, 3, 6]] + np.array([0, 0, 0.8])
    found = module.network(terrain.scene, tops)
    for i, j in ((0, 1), (1, 2), (0, 2)):
        expected, clearance = terrain.sees(tops[i], tops[j])
        assert clearance > 1e-6
        assert found[i, j] == found[j, i] == expected
    z = np.random.default_rng(1).random((40, 50))
    places = module.high_places(z)
    assert len(np.unique(places, axis=0)) == module.BLOCKS**2
    assert tuple(np.unravel_index(z.argmax(), z.shape)) in set(map(tuple, places.tolist()))
