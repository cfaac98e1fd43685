"""`wive.trimesh.RayMeshIntersector` gives trimesh's own results if these are right, and follows its mesh."""

import copy
import pickle

import numpy as np
import pytest
from support.meshes import all_crossings, random_rays, soup, sphere

import wive
import wive.trimesh

trimesh = pytest.importorskip("trimesh")

pytestmark = pytest.mark.timeout(120)


def own(vertices, faces):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    return mesh, wive.trimesh.RayMeshIntersector(mesh)


def theirs(mesh):
    """Trimesh's own intersector; skips if embreex is not installed."""
    pytest.importorskip("embreex")
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    return RayMeshIntersector(mesh)


def clear_rays(mesh, count, seed):
    """Rays that pass no edge closely, meet no triangle edge-on and leave room between hits."""
    origins, directions = random_rays(count, seed, low=-0.5, high=1.5)
    vertices, faces = np.float32(mesh.vertices), np.asarray(mesh.faces)
    t, clear = all_crossings(vertices, faces, origins, directions)
    farthest = np.where(np.isfinite(t), t, 1e9 * (1 + np.arange(len(faces))))
    gaps = np.diff(np.sort(farthest, axis=1), axis=1).min(axis=1)
    kept = (clear.min(axis=1) > 1e-3) & (gaps > 1e-3)
    return origins[kept].astype(np.float64), directions[kept].astype(np.float64)


def sorted_rows(triangles, rays, *points):
    order = np.lexsort([triangles, rays])
    return [column[order] for column in (triangles, rays, *points)]


@pytest.mark.parametrize("multiple_hits", [True, False])
def test_hits_are_those_of_trimesh(multiple_hits):
    mesh, ours = own(*soup(60, seed=1, size=0.3))
    rays = clear_rays(mesh, 1500, seed=2)
    settings = {"multiple_hits": multiple_hits, "return_locations": True}
    found, expected = ours.intersects_id(*rays, **settings), theirs(mesh).intersects_id(*rays, **settings)
    assert len(expected[0]) > 200
    for mine, other in zip(sorted_rows(*found), sorted_rows(*expected), strict=True):
        assert mine.dtype == other.dtype
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-9)
    located = ours.intersects_location(*rays, multiple_hits=multiple_hits)
    for mine, other in zip(located, (found[2], found[1], found[0]), strict=True):
        np.testing.assert_array_equal(mine, other)
    np.testing.assert_array_equal(ours.intersects_first(*rays), theirs(mesh).intersects_first(*rays))
    np.testing.assert_array_equal(ours.intersects_any(*rays), theirs(mesh).intersects_any(*rays))


def test_rows_and_types_are_those_of_trimeshs_embree():
    mesh, ours = own(*soup(60, seed=1, size=0.3))
    rays = clear_rays(mesh, 1500, seed=2)
    expected = theirs(mesh)
    for mine, other in (
        *zip(ours.intersects_id(*rays), expected.intersects_id(*rays), strict=True),
        *zip(ours.intersects_id(*rays, max_hits=2), expected.intersects_id(*rays, max_hits=2), strict=True),
        (ours.intersects_first(*rays), expected.intersects_first(*rays)),
        (ours.intersects_any(*rays), expected.intersects_any(*rays)),
    ):
        assert mine.dtype == other.dtype
        np.testing.assert_array_equal(mine, other)


def test_no_hit_is_missing_among_hundreds_close_together():
    heights = 1 + np.arange(300) * 1e-6
    corners = np.tile([[-1.0, -1, 0], [3, -1, 0], [-1, 3, 0]], (300, 1, 1))
    corners[:, :, 2] = heights[:, None]
    _, ours = own(corners.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    points, rays, triangles = ours.intersects_location([[0, 0, 0.0]], [[0, 0, 5.0]])
    np.testing.assert_array_equal(triangles, np.arange(300))
    np.testing.assert_array_equal(rays, 0)
    np.testing.assert_allclose(points[:, 2], heights, rtol=1e-15)
    assert len(ours.intersects_id([[0, 0, 0.0]], [[0, 0, 1.0]], max_hits=7)[0]) == 7


@pytest.mark.parametrize(
    ("size", "place"),
    [
        (1e-6, (0, 0, 0)),
        (1, (0, 0, 0)),
        (1e7, (0, 0, 0)),
        (1, (448262.25, 5411932.5, 120)),
        (1e3, (0, -4e8, 0)),
    ],
)
def test_points_inside_a_sphere_are_distinguished_from_points_outside(place, size):
    vertices, faces = sphere(4)
    vertices = vertices.astype(np.float64) * size + place
    _, ours = own(vertices, faces)
    random = np.random.default_rng(3)
    directions = random.standard_normal((20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    # The faces lie between 0.997 of the radius and all of it.
    inside = np.arange(20_000) % 2 == 0
    distance = np.where(inside, random.uniform(0, 0.99, 20_000), random.uniform(1.01, 2, 20_000))
    points = directions * distance[:, None] * size + place
    np.testing.assert_array_equal(ours.contains_points(points), inside)


def test_the_points_of_a_grid_inside_a_cube_with_a_cavity_are_found():
    """Rays through edges and vertices, at which parity by rays easily goes wrong."""
    outer, inner = trimesh.creation.box((4, 4, 4)), trimesh.creation.box((2, 2, 2))
    inner.invert()
    mesh = trimesh.util.concatenate([outer, inner])
    mesh.ray = wive.trimesh.RayMeshIntersector(mesh)
    axis = np.arange(-2.5, 2.6, 0.25) + 0.125
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    farthest = abs(points).max(axis=1)
    np.testing.assert_array_equal(mesh.contains(points), (farthest < 2) & (farthest > 1))
    np.testing.assert_array_equal(mesh.contains(np.zeros((0, 3))), np.zeros(0, bool))


def test_trimesh_functions_that_use_rays_work_with_the_adapter():
    mesh, ours = own(*sphere(3))
    mesh.ray = ours
    points, faces = trimesh.sample.sample_surface(mesh, 200, seed=6)
    found = trimesh.proximity.thickness(mesh, points, normals=mesh.face_normals[faces], method="ray")
    np.testing.assert_allclose(found, 2, atol=0.02)


def test_changes_of_the_mesh_are_followed():
    mesh, ours = own(*sphere(2))
    ray = [[0.0, 0, 0]], [[0.0, 0, 1]]
    before = ours.scene
    assert ours.scene is before
    assert ours.intersects_any(*ray)[0]
    mesh.apply_translation([10, 0, 0])
    assert not ours.intersects_any(*ray)[0]
    assert ours.scene is not before
    mesh.vertices[:, 0] -= 10
    assert ours.intersects_any(*ray)[0]


def test_pickles_and_copies_give_the_same_hits():
    mesh, ours = own(*sphere(2))
    mesh.ray = ours
    rays = random_rays(300, seed=4)
    expected = ours.intersects_first(*rays)
    for other in (pickle.loads(pickle.dumps(ours)), copy.copy(ours), copy.deepcopy(ours)):
        np.testing.assert_array_equal(other.intersects_first(*rays), expected)
    again = pickle.loads(pickle.dumps(mesh))
    np.testing.assert_array_equal(again.ray.intersects_first(*rays), expected)


def test_backend_and_accuracy_are_those_requested(backend):
    mesh, _ = own(*sphere(2))
    rays = random_rays(50, seed=5, low=-0.3, high=0.3)
    options = {"backend": backend, "accuracy": "fast"}
    ours = wive.trimesh.RayMeshIntersector(mesh, **options, threads=None if backend == "warp" else 1)
    assert (ours.scene.backend, ours.scene.accuracy) == (backend, "fast")
    assert (ours.intersects_first(*rays) >= 0).all()
    if backend == "warp":
        with pytest.raises(ValueError, match="threads is only for CPU backends"):
            wive.trimesh.RayMeshIntersector(mesh, **options, threads=1).intersects_first(*rays)


def test_invalid_rays_and_meshes_without_faces_hit_nothing():
    _, ours = own(*sphere(1))
    origins, directions = np.zeros((3, 3)), np.array([[0, 0, 0], [np.nan, 0, 1], [0.1, 0.2, 0.9]])
    np.testing.assert_array_equal(ours.intersects_first(origins, directions) >= 0, [False, False, True])
    np.testing.assert_array_equal(ours.intersects_id(origins, directions)[1], [2])
    empty = wive.trimesh.RayMeshIntersector(trimesh.Trimesh())
    assert not empty.intersects_any(origins, directions).any()
    assert not empty.contains_points(origins).any()
    assert [len(column) for column in empty.intersects_location(origins, directions)] == [0, 0, 0]


def test_bad_input_is_refused_in_one_line():
    _, ours = own(*sphere(1))
    with pytest.raises(TypeError, match=r"geometry must be a trimesh\.Trimesh, got str without vertices"):
        wive.trimesh.RayMeshIntersector("mesh.ply")
    for query in (ours.intersects_id, ours.intersects_location, ours.intersects_first, ours.intersects_any):
        with pytest.raises(ValueError, match=r"must both have shape \(n, 3\), got \(2, 3\) and \(1, 3\)"):
            query(np.zeros((2, 3)), np.zeros((1, 3)))
    with pytest.raises(ValueError, match=r"points must have shape \(n, 3\), got \(3,\)"):
        ours.contains_points([0.0, 0, 0])
