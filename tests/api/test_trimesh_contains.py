"""`contains_points` is right for faces stored twice, walls that are shared, and lines through vertices."""

import numpy as np
import pytest

import wive.trimesh
from wive._internal.inside import DIRECTIONS

trimesh = pytest.importorskip("trimesh")

pytestmark = pytest.mark.timeout(120)

# The faces of a cube, and how quads become triangles.
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def fans(quads):
    return np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def contained(points, vertices, faces, **options):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    return wive.trimesh.RayMeshIntersector(mesh, **options).contains_points(points)


def doubled(vertices, faces):
    """The mesh with faces stored more than once, in all ways that exporters have."""
    turned, shift = faces[:, ::-1], len(vertices)
    signed = np.where(vertices == 0, -0.0, vertices)
    yield vertices, np.vstack([faces, faces])
    yield vertices, np.vstack([faces, turned])
    yield vertices, np.vstack([turned, faces, turned])
    yield vertices, np.random.default_rng(1).permutation(np.vstack([faces, np.roll(turned, 1, axis=1)]))
    yield np.vstack([vertices, vertices]), np.vstack([faces, turned + shift])
    yield np.vstack([vertices, signed]), np.vstack([faces, faces + shift])
    yield vertices[np.vstack([faces, turned])].reshape(-1, 3), np.arange(6 * len(faces)).reshape(-1, 3)
    yield vertices, np.vstack([faces, turned[: len(faces) // 3]])
    yield vertices, np.vstack([faces, faces[:1]])


@pytest.mark.parametrize(
    ("name", "size"),
    [("box", {}), ("icosphere", {"subdivisions": 2}), ("torus", {"major_radius": 1, "minor_radius": 0.3})],
)
@pytest.mark.parametrize("options", [{}, {"accuracy": "exact"}, {"dtype": np.float64}], ids=str)
def test_faces_stored_more_than_once_change_nothing(name, size, options):
    mesh = getattr(trimesh.creation, name)(**size)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    points = 1.05 * np.random.default_rng(0).uniform(*mesh.bounds, (2000, 3))
    expected = contained(points, vertices, faces, **options)
    assert 0.1 < expected.mean() < 0.9
    for other in doubled(vertices, faces):
        np.testing.assert_array_equal(contained(points, *other, **options), expected)


def test_quads_that_were_split_along_other_diagonals_are_one_surface():
    points = np.random.default_rng(2).uniform(-0.6, 0.6, (4000, 3))
    inside = (abs(points) < 0.5).all(axis=1)
    for other in (QUADS[:, ::-1], np.roll(QUADS, 1, axis=1), QUADS[:1, ::-1]):
        found = contained(points, CORNERS, np.vstack([fans(QUADS), fans(other)]))
        np.testing.assert_array_equal(found, inside)


@pytest.mark.parametrize("options", [{}, {"accuracy": "exact"}, {"dtype": np.float64}], ids=str)
@pytest.mark.parametrize("place", [(0, 0, 0), (0.1, 0.2, 0.3), (448262.25, 5411932.5, 120)])
def test_a_second_copy_with_other_triangles_is_the_same_surface(options, place):
    """Each copy is closed, and no edge of one is an edge of the other; far away its vertices are rounded."""
    for name in ("box", "icosahedron", "annulus"):
        sizes = {"r_min": 0.5, "r_max": 1.0, "height": 1.0} if name == "annulus" else {}
        mesh = getattr(trimesh.creation, name)(**sizes)
        points = 1.05 * np.random.default_rng(5).uniform(*mesh.bounds, (2000, 3)) + place
        mesh.apply_translation(place)
        alone = contained(points, mesh.vertices, mesh.faces, **options)
        assert 0.1 < alone.mean() < 0.95
        finer = mesh.subdivide()
        for faces in (finer.faces, finer.faces[:, ::-1]):
            both = np.vstack([mesh.faces, faces + len(mesh.vertices)])
            vertices = np.vstack([mesh.vertices, finer.vertices])
            np.testing.assert_array_equal(contained(points, vertices, both, **options), alone)


@pytest.mark.parametrize("offset", [(1, 0, 0), (1, 1, 0), (1, 1, 1), (0.5, 0.5, 0.5), (3, 0, 0)])
def test_boxes_that_touch_or_share_a_wall_are_solid(offset):
    """Where they overlap, parity says outside, as in trimesh."""
    both = np.vstack([CORNERS, CORNERS + offset]), np.vstack([fans(QUADS), fans(QUADS) + 8])
    points = np.random.default_rng(3).uniform(-0.7, np.array(offset) + 0.7, (4000, 3))
    inside = (abs(points) < 0.5).all(axis=1) ^ (abs(points - offset) < 0.5).all(axis=1)
    np.testing.assert_array_equal(contained(points, *both), inside)


def test_a_cavity_is_outside_however_its_faces_are_stored():
    outer, inner = fans(QUADS), fans(QUADS) + 8
    vertices = np.vstack([CORNERS, CORNERS / 2])
    points = np.random.default_rng(4).uniform(-0.6, 0.6, (2000, 3))
    inside = (abs(points) < 0.5).all(axis=1) & (abs(points) > 0.25).any(axis=1)
    for faces in ([outer, inner], [outer, inner[:, ::-1]], [outer, inner, inner[:, ::-1], outer[:, ::-1]]):
        np.testing.assert_array_equal(contained(points, vertices, np.vstack(faces)), inside)


@pytest.mark.parametrize("accuracy", ["watertight", "exact"])
@pytest.mark.parametrize("place", [(0, 0, 0), (0.1, 0.2, 0.3), (1000, -2000, 5000)])
def test_points_whose_test_line_meets_vertices_are_inside(accuracy, place):
    faces = [[0, 2, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2], [1, 4, 2], [1, 3, 4], [1, 5, 3], [1, 2, 5]]
    for direction in DIRECTIONS:
        across = np.cross(direction, [0, 0, 1.0])
        across /= np.linalg.norm(across)
        along = np.cross(direction, across)
        vertices = np.array([direction, -direction, across, -across, along, -along]) + place
        points = np.array([place, np.add(place, 3), place + 1.5 * direction, place - 0.4 * direction])
        for stored in (faces, np.vstack([faces, np.flip(faces, 1)])):
            found = contained(points, vertices, stored, accuracy=accuracy)
            np.testing.assert_array_equal(found, [True, False, False, True])
