"""Closest points of trimesh's meshes by wive: the same as trimesh's own, and what rests on them."""

import numpy as np
import pytest

import wive

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def part() -> "trimesh.Trimesh":
    mesh = trimesh.creation.annulus(r_min=0.5, r_max=1, height=2, sections=24)
    mesh.apply_translation([300, -20, 7])
    return mesh


def places(mesh: "trimesh.Trimesh", count: int = 400) -> np.ndarray:
    random = np.random.default_rng(1)
    low, high = mesh.bounds
    return random.uniform(low - 0.7, high + 0.7, (count, 3))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_closest_points_are_trimeshs(part: "trimesh.Trimesh", dtype: type) -> None:
    points = places(part)
    expected, distances, _ = trimesh.proximity.closest_point_naive(part, points)
    with wive.trimesh.installed(dtype=dtype):
        for found in (trimesh.proximity.closest_point(part, points), part.nearest.on_surface(points)):
            np.testing.assert_allclose(found[1], distances, atol=1e-6)
            same = np.linalg.norm(found[0] - expected, axis=1) < 1e-5
            assert same.mean() > 0.98  # others have two
            np.testing.assert_allclose(np.linalg.norm(found[0] - points, axis=1), found[1], atol=1e-12)
            assert found[2].dtype == np.int64
            corners = part.triangles[found[2]]
            again = trimesh.triangles.closest_point(corners, points)
            np.testing.assert_allclose(again, found[0], atol=1e-9)


def test_signed_distance_and_thickness_are_trimeshs(
    part: "trimesh.Trimesh", monkeypatch: pytest.MonkeyPatch
) -> None:
    points = places(part)
    samples, faces = trimesh.sample.sample_surface(part, 60, seed=1)
    normals = part.face_normals[faces]
    proximity = trimesh.proximity

    def answers() -> list[np.ndarray]:
        balls = proximity.thickness(part, samples, normals=normals, method="max_sphere")
        return [proximity.signed_distance(part, points), balls]

    with wive.trimesh.installed(dtype=np.float64):
        ours = answers()
    monkeypatch.setattr(proximity, "closest_point", proximity.closest_point_naive)  # its own needs rtree
    for one, other in zip(answers(), ours, strict=True):
        assert np.isfinite(one).all() and np.isfinite(other).all()
        assert (abs(one - other) < 1e-5).mean() > 0.97


def test_the_function_is_put_back(part: "trimesh.Trimesh") -> None:
    own = trimesh.proximity.closest_point
    with wive.trimesh.installed():
        ours = trimesh.proximity.closest_point
        assert ours is not own
        with wive.trimesh.installed(dtype=np.float64):
            assert trimesh.proximity.closest_point is ours
        assert trimesh.proximity.closest_point is ours
    assert trimesh.proximity.closest_point is own
    wive.trimesh.install()
    wive.trimesh.uninstall()
    wive.trimesh.uninstall()
    assert trimesh.proximity.closest_point is own


def test_a_mesh_without_triangles_is_refused_and_a_point_nowhere_has_no_place(
    part: "trimesh.Trimesh",
) -> None:
    nowhere = [[np.nan, 0, 0]]
    with wive.trimesh.installed():
        for query in ("on_surface", "signed_distance"):
            with pytest.raises(ValueError, match=r"^mesh must have triangles"):
                getattr(trimesh.Trimesh().nearest, query)([[0, 0, 0]])
        assert np.isnan(part.nearest.signed_distance(nowhere)).all()
        assert part.nearest.on_surface(nowhere)[2] == [-1]


def test_a_mesh_with_an_intersector_of_its_own_keeps_trimeshs(
    part: "trimesh.Trimesh", monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trimesh.proximity, "closest_point", lambda mesh, points: "trimesh's")
    with wive.trimesh.installed():
        assert len(trimesh.proximity.closest_point(part, places(part))) == 3
        part.ray = object()
        assert trimesh.proximity.closest_point(part, places(part)) == "trimesh's"


def test_one_intersector_alone_has_closest_points_and_follows_the_mesh(part: "trimesh.Trimesh") -> None:
    rays = wive.trimesh.RayMeshIntersector(part)
    closest, distance, triangle = rays.closest_point([[300, -20, 7], [np.nan, 0, 0]])
    assert distance[0] == pytest.approx(0.5, rel=0.01) and np.isinf(distance[1])
    assert triangle[1] == -1 and np.isnan(closest[1]).all()
    part.apply_scale(2)
    assert rays.closest_point([[600, -40, 14]])[1][0] == pytest.approx(1, rel=0.01)
    with pytest.raises(ValueError, match=r"^points must have shape"):
        rays.closest_point([1, 2])


@pytest.mark.parametrize("scale", [1e-60, 1e-30, 1e30, 1e60])
def test_meshes_of_every_size_have_closest_points(scale: float) -> None:
    mesh = trimesh.creation.box((2, 2, 2))
    mesh.apply_scale(scale)
    _, distance, _ = wive.trimesh.RayMeshIntersector(mesh).closest_point(np.array([[0, 0, 3.0]]) * scale)
    assert distance[0] == pytest.approx(2 * scale, rel=1e-6)
