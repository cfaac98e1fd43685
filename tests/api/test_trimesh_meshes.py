"""`wive.trimesh.RayMeshIntersector` takes every mesh and every array that trimesh's own takes."""

import numpy as np
import pytest
from support.meshes import sphere

from wive.trimesh import RayMeshIntersector

trimesh = pytest.importorskip("trimesh")

pytestmark = pytest.mark.timeout(120)

ORIGINS = np.array([[0.1, 0.2, -5], [0.2, 0.1, -5], [9, 9, -5.0]])
DIRECTIONS = np.array([[0, 0, 1], [0.01, 0.02, 2], [0, 0, 1.0]])


@pytest.fixture(scope="module")
def box():
    return trimesh.creation.box()


def test_an_intersector_is_made_before_its_mesh_has_data(monkeypatch):
    """Trimesh makes `mesh.ray` first of all."""
    module = pytest.importorskip("trimesh.ray.ray_pyembree")
    monkeypatch.setattr(module, "RayMeshIntersector", RayMeshIntersector)
    for mesh in (
        trimesh.creation.box(),
        trimesh.Trimesh(*sphere(1)),
        trimesh.primitives.Box(),
        trimesh.primitives.Sphere(),
        trimesh.primitives.Capsule(),
        trimesh.primitives.Cylinder(),
    ):
        assert isinstance(mesh.ray, RayMeshIntersector)
        assert mesh.ray._placed is None  # nothing is built before it is needed
        assert mesh.contains([[0.01, 0.02, 0.03], [0, 0, 7]]).tolist() == [True, False]
        assert mesh.copy().ray.intersects_any(ORIGINS, DIRECTIONS).tolist() == [True, True, False]


def test_a_primitive_that_changes_is_followed():
    ball = trimesh.primitives.Sphere(radius=1)
    ours = RayMeshIntersector(ball)
    assert not ours.intersects_any([[2, 0, -5.0]], [[0, 0, 1.0]])[0]
    ball.primitive.radius = 3
    assert ours.intersects_any([[2, 0, -5.0]], [[0, 0, 1.0]])[0]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_triangles_without_a_place_are_never_hit(box, value):
    vertices = np.array(box.vertices)
    vertices[0] = value
    whole = ~(box.faces == 0).any(axis=1)
    ours = RayMeshIntersector(trimesh.Trimesh(vertices, box.faces, process=False))
    rest = RayMeshIntersector(trimesh.Trimesh(box.vertices, box.faces[whole], process=False))
    triangles, rays, points = ours.intersects_id(ORIGINS, DIRECTIONS, return_locations=True)
    expected = rest.intersects_id(ORIGINS, DIRECTIONS, return_locations=True)
    assert len(triangles) > 0
    np.testing.assert_array_equal(triangles, np.flatnonzero(whole)[expected[0]])
    np.testing.assert_array_equal(rays, expected[1])
    np.testing.assert_allclose(points, expected[2], atol=1e-12)
    none = RayMeshIntersector(trimesh.Trimesh(np.full((8, 3), value), box.faces, process=False))
    assert none.intersects_first(ORIGINS, DIRECTIONS).tolist() == [-1, -1, -1]
    assert not none.contains_points(np.zeros((2, 3))).any()


def test_meshes_without_faces_or_vertices_hit_nothing(box):
    for mesh in (
        trimesh.Trimesh(),
        trimesh.Trimesh(vertices=np.eye(3)),
        trimesh.Trimesh(box.vertices, np.zeros((0, 3), int)),
    ):
        ours = RayMeshIntersector(mesh)
        assert not ours.intersects_any(ORIGINS, DIRECTIONS).any()
        assert [len(column) for column in ours.intersects_location(ORIGINS, DIRECTIONS)] == [0, 0, 0]
        assert not ours.contains_points(ORIGINS).any()


def test_a_face_without_its_vertex_is_named(box):
    mesh = trimesh.Trimesh(box.vertices, [[0, 1, 2], [0, 1, 99]], process=False)
    with pytest.raises(ValueError, match=r"must index its 8 vertices from 0, got \[0, 1, 99\] in face 1"):
        RayMeshIntersector(mesh).intersects_any(ORIGINS, DIRECTIONS)


def test_any_memory_order_and_kind_of_array_gives_the_same_hits(box):
    ours = RayMeshIntersector(box)
    expected = ours.intersects_location(ORIGINS, DIRECTIONS)
    assert len(expected[0]) == 4
    padded = np.zeros((6, 6))
    padded[::2, ::2] = ORIGINS
    kinds = {
        "Fortran": np.asfortranarray,
        "strided": lambda rows: np.repeat(rows, 2, axis=0)[::2],
        "backwards": lambda rows: rows[::-1].copy()[::-1],
        "columns": lambda rows: np.array(rows.T.tolist()).T,
        "lists": np.ndarray.tolist,
        "big-endian": lambda rows: rows.astype(">f8"),
        "longdouble": lambda rows: rows.astype(np.longdouble),
        "read-only": lambda rows: np.frombuffer(rows.tobytes()).reshape(-1, 3),
        "unaligned": lambda rows: (
            np.frombuffer(b"x" + rows.tobytes(), np.uint8)[1:].view(float).reshape(-1, 3)
        ),
    }
    for first in kinds.values():
        for second in kinds.values():
            found = ours.intersects_location(first(ORIGINS), second(DIRECTIONS))
            for mine, other in zip(found, expected, strict=True):
                np.testing.assert_array_equal(mine, other)
    shared = np.broadcast_to(DIRECTIONS[0], (3, 3))
    assert ours.intersects_any(padded[::2, ::2], shared).tolist() == [True, True, False]
    assert ours.contains_points(np.asfortranarray(ORIGINS / 10)).tolist() == [True, True, False]


def test_masked_rays_and_points_miss(box):
    ours = RayMeshIntersector(box)
    mask = [[0, 0, 0], [0, 1, 0], [0, 0, 0]]
    origins, directions = (np.ma.masked_array(rows, mask=mask) for rows in (ORIGINS, DIRECTIONS))
    for rays in ((origins, DIRECTIONS), (ORIGINS, directions)):
        assert ours.intersects_any(*rays).tolist() == [True, False, False]
        assert ours.intersects_id(*rays)[1].tolist() == [0, 0]
    assert ours.contains_points(np.ma.masked_array(np.zeros((3, 3)), mask=mask)).tolist() == [1, 0, 1]


def test_one_place_is_one_hit(box):
    ours, theirs = RayMeshIntersector(box), []
    rays = [[0, 0, 5.0]], [[0, 0, -1.0]]
    assert len(ours.intersects_location(*rays)[0]) == 2
    assert len(ours.intersects_id(*rays)[0]) == 2
    assert ours.intersects_location(*rays)[0][:, 2].tolist() == [0.5, -0.5]
    for faces in (np.vstack([box.faces] * 2), np.vstack([box.faces, box.faces[:, ::-1]])):
        doubled = RayMeshIntersector(trimesh.Trimesh(box.vertices, faces, process=False))
        theirs = ours.intersects_location(ORIGINS, DIRECTIONS)
        for mine, other in zip(doubled.intersects_location(ORIGINS, DIRECTIONS), theirs, strict=True):
            np.testing.assert_allclose(mine, other, atol=1e-12)
        assert len(doubled.intersects_id(ORIGINS, DIRECTIONS, max_hits=1)[0]) == 2


@pytest.mark.parametrize("accuracy", ["fast", "watertight", "exact"])
@pytest.mark.parametrize("place", [(0, 0, 0), (448262.25, 5411932.5, 120)])
def test_a_sphere_is_hit_from_any_distance(accuracy, place):
    vertices, faces = sphere(3)
    ours = RayMeshIntersector(
        trimesh.Trimesh(vertices.astype(float) + place, faces, process=False), accuracy=accuracy
    )
    random = np.random.default_rng(1)
    targets, directions = random.uniform(-0.5, 0.5, (300, 3)), random.standard_normal((300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    near = ours.intersects_location(targets + place - 3 * directions, directions, multiple_hits=False)
    for distance in (1e2, 1e4, 1e7, 1e10):
        rays = targets + place - distance * directions, directions
        found = ours.intersects_location(*rays, multiple_hits=False)
        # float64 resolves origins to 1e-16 of their size
        np.testing.assert_allclose(found[0], near[0], rtol=0, atol=1e-5 + 1e-15 * distance)
        assert len(ours.intersects_location(*rays)[0]) == 600
        assert not ours.intersects_any(rays[0], -directions).any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_origin_may_be_any_number(dtype):
    """Beyond 1e16 sizes doubles do not resolve the mesh along the ray, beyond 1e18 scenes take no origins."""
    vertices, faces = sphere(3)
    for size in (1e-30, 1, 1e12, 1e30):
        ours = RayMeshIntersector(
            trimesh.Trimesh(vertices.astype(float) * size, faces, process=False), dtype=dtype
        )
        directions = np.array([[0, 0, 1.0], [0, -1, 0]])
        targets = size * np.array([[0.125, 0.25, 0], [0.25, 0, 0.125]])
        near = ours.intersects_location(targets - 3 * size * directions, directions)
        assert len(near[0]) == 4
        for distance in (1e6, 1e9, 1e15, 1e17, 1e20, 1e100, 1e250):
            origins = targets - size * distance * directions
            for mine, other in zip(ours.intersects_location(origins, directions), near, strict=True):
                np.testing.assert_allclose(mine, other, rtol=0, atol=1e-12 * size)
            assert ours.intersects_any(origins, directions).all()
            assert not ours.intersects_any(origins, -directions).any()
        assert not ours.intersects_any([[np.inf, 0, 0], [0, 0, 1.7e308]], [[-1, 0, 0], [0, 1, 0.0]]).any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e-130, 1e-105, 1e-90, 1e90, 1e105, 1e160, 1e300])
def test_a_mesh_may_have_any_size(size, dtype):
    vertices, faces = sphere(3)
    mesh = trimesh.Trimesh(vertices.astype(float) * size, faces, process=False)
    doubled = trimesh.Trimesh(mesh.vertices, np.vstack([faces, faces[:, ::-1]]), process=False)
    rays = np.array([[0.1, 0.2, -5], [0, 0, 5.0]]) * size, np.array([[0, 0, 1.0], [0.01, 0, 1]])
    expected = RayMeshIntersector(trimesh.Trimesh(vertices, faces, process=False)).intersects_location(
        rays[0] / size, rays[1]
    )
    for ours in (RayMeshIntersector(mesh, dtype=dtype), RayMeshIntersector(doubled, dtype=dtype)):
        points, rows, _ = ours.intersects_location(*rays)
        assert rows.tolist() == expected[1].tolist() == [0, 0]
        np.testing.assert_allclose(points / size, expected[0], rtol=0, atol=1e-12)
        inside = ours.contains_points(np.array([[0.1, 0.2, 0.3], [0.9, 0.9, 0.9]]) * size)
        assert inside.tolist() == [True, False]


def test_directions_of_any_length_are_directions(box):
    ours = RayMeshIntersector(box)
    for length in (1e-320, 1e-200, 1e-3, 1e200, 1e308):
        found = ours.intersects_location(ORIGINS[:1], DIRECTIONS[:1] * length)
        np.testing.assert_allclose(found[0][:, 2], [-0.5, 0.5])


@pytest.mark.parametrize("bad", [trimesh.Trimesh, trimesh.Scene(), trimesh.PointCloud(np.eye(3)), None])
def test_what_is_no_mesh_is_refused(bad):
    with pytest.raises(TypeError, match=r"^geometry must be a trimesh.Trimesh, got \w+ without "):
        RayMeshIntersector(bad)


def test_bad_arguments_are_refused_by_their_names(box):
    ours = RayMeshIntersector(box)
    for bad, kind in (
        ("abc", TypeError),
        ([[1, 2], [1, 2, 3]], ValueError),
        (None, TypeError),
        ([[1, 2]], ValueError),
    ):
        for name, call in {
            "ray_origins": lambda bad=bad: ours.intersects_any(bad, DIRECTIONS),
            "ray_directions": lambda bad=bad: ours.intersects_id(ORIGINS, bad),
            "points": lambda bad=bad: ours.contains_points(bad),
        }.items():
            with pytest.raises(kind, match=f"^{name} must"):
                call()
    for bad, kind in (
        ("x", TypeError),
        (1.5, TypeError),
        (np.nan, TypeError),
        (-1, ValueError),
        ([1], TypeError),
    ):
        for multiple in (True, False):
            with pytest.raises(kind, match=r"^max_hits must be"):
                ours.intersects_id(ORIGINS, DIRECTIONS, multiple, max_hits=bad)
    assert len(ours.intersects_id(ORIGINS, DIRECTIONS, max_hits=np.int64(1))[0]) == 2
    assert len(ours.intersects_id(ORIGINS, DIRECTIONS, max_hits=0)[0]) == 0
    with pytest.raises(ValueError, match=r"^dtype must be float32 or float64"):
        RayMeshIntersector(box, dtype="float16")
    with pytest.raises(ValueError, match=r"^dtype must be float32 for accuracy 'exact', got float64"):
        RayMeshIntersector(box, dtype=np.float64, accuracy="exact")
