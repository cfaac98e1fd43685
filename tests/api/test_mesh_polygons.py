"""Polygons of mesh files become n - 2 triangles that cover them once."""

import numpy as np
import pytest

from wive._internal.formats import ears
from wive._internal.formats.triangulate import triangulate


def area(points: np.ndarray) -> float:
    """Of a polygon in the plane, positive if it is counter-clockwise."""
    x, y = points.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def star(count: int, random: np.random.Generator) -> np.ndarray:
    """A polygon around the origin with spikes of random lengths."""
    angles = (np.arange(count) + random.uniform(0, 0.9, count)) * 2 * np.pi / count
    return random.uniform(0.2, 1, count)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def turned(points: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """The polygon somewhere in space."""
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    return np.pad(points, ((0, 0), (0, 1))) @ rotation * random.choice([1e-6, 1, 1e6]) + random.normal(size=3)


def triangles_of(points: np.ndarray) -> np.ndarray:
    return triangulate(points, np.array([len(points)]), np.arange(len(points)), "file")


def assert_covers(polygon: np.ndarray, triangles: np.ndarray) -> None:
    """Triangles with area, none turned over, whose areas add up to the polygon's: they cover it once."""
    assert triangles.shape == (len(polygon) - 2, 3)
    one, other = np.moveaxis(polygon[triangles[:, 1:]] - polygon[triangles[:, :1]], 1, 0)
    areas = (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(area(polygon), rel=1e-9)


@pytest.mark.parametrize("count", [4, 5, 6, 9, 17, 100])
def test_concave_polygons_anywhere_in_space(count):
    random = np.random.default_rng(count)
    for _ in range(200 // count):
        polygon = np.roll(star(count, random), random.integers(count), axis=0)
        assert_covers(polygon, triangles_of(turned(polygon, random)))
        assert_covers(polygon[::-1] * [-1, 1], triangles_of(turned(polygon[::-1] * [-1, 1], random)))


def test_convex_polygons_are_fans_from_their_first_corner():
    random = np.random.default_rng(8)
    for count in range(4, 12):
        angles = np.sort(random.uniform(0, 2 * np.pi, count))
        polygon = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        fan = [[0, number, number + 1] for number in range(1, count - 1)]
        assert triangles_of(turned(polygon, random)).tolist() == fan


SHAPES = {
    "arrow": [(0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)],
    "L": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    "comb": [(0, 0), (9, 0), (9, 2), (8, 1), (7, 2), (6, 1), (5, 2), (4, 1), (3, 2), (2, 1), (1, 2), (0, 1)],
    "midpoints of edges": [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)],
    "triangle with five more on an edge": [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (6, 0), (3, 4)],
    "square with a hole": [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)],
    "spiral": [
        *((0, 0), (6, 0), (6, 6), (1, 6), (1, 2), (4, 2), (4, 4), (3, 4), (3, 3), (2, 3), (2, 5), (5, 5)),
        *((5, 1), (0, 1)),
    ],
}


@pytest.mark.parametrize("points", SHAPES.values(), ids=SHAPES)
def test_shapes_from_every_first_corner(points):
    polygon = np.array(points, float)
    for first in range(len(polygon)):
        rolled = np.roll(polygon, first, axis=0)
        assert_covers(rolled, triangles_of(np.pad(rolled, ((0, 0), (0, 1)))))


def test_quads_are_cut_where_both_triangles_are_inside():
    dart = np.array([[0, 0], [2, 1], [0, 2], [0.5, 1]], float)
    for first in range(4):
        rolled = np.roll(dart, first, axis=0)
        assert_covers(rolled, triangles_of(np.pad(rolled, ((0, 0), (0, 1)))))


def test_quads_that_are_triangles_stay_so():
    corner = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0]], float)
    for twice in range(3):
        triangles = triangles_of(np.insert(corner, twice, corner[twice], axis=0))
        assert triangles.tolist() == [[0, 1, 2], [0, 2, 3]] or twice == 0
        areas = np.abs([area(np.insert(corner, twice, corner[twice], axis=0)[t][:, :2]) for t in triangles])
        assert sorted(areas) == [0, 2]


def test_many_polygons_of_several_sizes_stay_in_order():
    random = np.random.default_rng(10)
    sizes = random.integers(3, 9, 1000)
    polygons = [star(size, random) for size in sizes]
    vertices = np.concatenate(
        [np.pad(p, ((0, 0), (0, 1)), constant_values=i) for i, p in enumerate(polygons)]
    )
    triangles = triangulate(vertices, sizes, np.arange(sizes.sum()), "file")
    heights = vertices[triangles][:, :, 2]
    assert (heights[:, 0] == np.repeat(np.arange(1000), sizes - 2)).all()
    assert (heights == heights[:, :1]).all()
    ends = np.cumsum(sizes - 2)
    for number in range(0, 1000, 50):
        local = triangles[ends[number] - (sizes[number] - 2) : ends[number]] - (sizes[:number].sum())
        assert_covers(polygons[number], local)


def test_bent_quads_and_polygons_without_area_keep_their_corners():
    bent = np.array([[0, 0, 0], [1, 0, 0.4], [1, 1, 0], [0, 1, 0.4]])
    assert triangles_of(bent).tolist() == [[0, 1, 2], [0, 2, 3]]
    for points in (np.zeros((5, 3)), np.arange(15.0).reshape(5, 3), np.full((5, 3), np.nan)):
        assert triangles_of(points).tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


@pytest.mark.parametrize("scale", [1e-300, 1e-30, 1e30, 1e307])
def test_size_does_not_matter(scale):
    polygon = np.array(SHAPES["arrow"])
    assert_covers(polygon, triangles_of(np.pad(polygon, ((0, 0), (0, 1))) * scale))


def test_polygons_that_cross_themselves_give_as_many_triangles():
    random = np.random.default_rng(11)
    for count in (4, 5, 8, 30, 200):
        triangles = triangles_of(random.normal(size=(count, 3)))
        assert triangles.shape == (count - 2, 3)
        assert set(triangles.ravel()) == set(range(count))


def test_an_outline_of_many_corners_is_cut_and_a_tangle_is_refused():
    random = np.random.default_rng(12)
    angles = np.arange(3000) * 2 * np.pi / 3000
    waves = np.arange(1, 100)
    sizes = random.normal(size=99) / waves**1.2 * 0.15
    radius = 1 + (sizes * np.cos(angles[:, None] * waves + random.uniform(0, 6, 99))).sum(axis=1)
    outline = radius[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert_covers(outline, triangles_of(turned(outline, random)))
    with pytest.raises(ValueError, match=r"^file: a polygon of 600,001 corners is too tangled: triangulate"):
        triangles_of(random.normal(size=(600_001, 3)))


@pytest.mark.parametrize("shape", ["stairs", "zigzag"])
def test_an_outline_whose_ears_are_long_is_cut(shape):
    steps = np.arange(14_000)
    outline, closing = {
        "stairs": (np.stack([(steps + 1) // 2, steps // 2], axis=1), [[0, 7000]]),
        "zigzag": (np.stack([steps, steps % 2], axis=1), [[14_000, 5], [0, 5]]),
    }[shape]
    outline = np.concatenate([outline, closing]).astype(float)
    assert_covers(outline, triangles_of(np.pad(outline, ((0, 0), (0, 1)))))


def test_corners_in_groups_are_the_same_as_one_by_one(monkeypatch):
    """Also of polygons that cross themselves, with corners at equal places and in lines."""
    random = np.random.default_rng(13)
    for number in range(300):
        count = int(random.integers(5, 80))
        points = star(count, random) if number % 2 else random.integers(0, 6, (count, 2)).astype(float)
        found = []
        for long, group in ((count + 1, 1), (1, int(random.integers(1, 9)))):
            monkeypatch.setattr(ears, "LONG", long)
            monkeypatch.setattr(ears, "GROUP", group)
            found.append(ears.ears(*points.T.tolist()))
        assert found[0] == found[1]
