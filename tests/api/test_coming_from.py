"""The tables in docs/coming_from.md: the calls of both sides of a row give the same."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from support.pages import ROOT

import wive

PAGE = (ROOT / "docs" / "coming_from.md").read_text(encoding="utf-8")
WIDTH, HEIGHT = 12, 8


def section(title: str) -> str:
    """A section of the page, from its heading to the next one."""
    begin = PAGE.index(f"## {title}\n")
    return PAGE[begin : (PAGE + "\n## ").index("\n## ", begin + 1)]


def rows_of(title: str) -> dict[str, list[str]]:
    """The code of each row of a section's tables: what the right cell has, by the first code on the left."""
    cells = re.findall(r"^\| (.*`.*) \| (.*) \|$", section(title), re.MULTILINE)
    found = [(re.findall("`([^`]+)`", left), re.findall("`([^`]+)`", right)) for left, right in cells]
    return {theirs[0]: ours for theirs, ours in found}


def rays(seed: int = 5, count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    origins, directions = random.uniform(-2, 2, (count, 3)), random.standard_normal((count, 3))
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def tube() -> tuple[np.ndarray, np.ndarray]:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.annulus(r_min=0.5, r_max=1, height=2, sections=17)
    return np.array(mesh.vertices), np.array(mesh.faces)


def same(found: object, expected: object, atol: float = 1e-5) -> None:
    found, expected = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    np.testing.assert_allclose(found, expected, atol=atol, rtol=1e-5)
    assert found.size == 3 or len(np.unique(found.round(3))) > 1


def by_ray(*parts: np.ndarray) -> list[np.ndarray]:
    """Parts of all hits, the last of which is the triangle, sorted by point and triangle."""
    order = np.lexsort(np.round(np.c_[parts[0], parts[-1]], 4).T)
    return [np.asarray(part, np.float64)[order] for part in parts]


class Table:
    """A table of the page: evaluates wive's side of a row, and knows which rows were."""

    def __init__(self, title: str, names: dict[str, Any]) -> None:
        self.rows, self.names, self.used = rows_of(title), {"np": np, "wive": wive, **names}, set[str]()

    def ours(self, theirs: str) -> Any:
        """The value of the right cell: of its last code, after the assignments before it."""
        self.used.add(theirs)
        for code in self.rows[theirs]:
            match = re.fullmatch(r"(\w+) = (.*)", code)
            value = eval(match[2] if match else code, self.names)
            if match:
                self.names[match[1]] = value
        return value

    def skip(self, *theirs: str) -> None:
        """Rows that say something else than two calls."""
        self.used.update(theirs)

    def expect_all_used(self) -> None:
        assert self.used == self.rows.keys()


def test_trimesh() -> None:
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = tube()
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    origins, directions = rays()
    points = origins * 0.6
    view = mesh.scene()
    view.camera.resolution = WIDTH, HEIGHT
    k, pose = view.camera.K.copy(), view.camera_transform @ np.diag([1, -1, -1, 1])
    k[:2, 2] -= 0.5
    names = {
        "mesh": mesh, "scene": wive.Scene(mesh), "points": points, "view": view, "k": k, "pose": pose,
        "origins": origins, "directions": directions,
    }  # fmt: skip
    table = Table("trimesh", names)
    intersector = mesh.ray
    for call in ("intersects_first", "intersects_any"):
        theirs = f"mesh.ray.{call}(origins, directions)"
        same(table.ours(theirs), eval(theirs, table.names))
    expected = by_ray(*intersector.intersects_location(origins, directions))
    row = "points, rays, triangles = mesh.ray.intersects_location(origins, directions)"
    for found, other in zip(by_ray(*table.ours(row)), expected, strict=True):
        same(found, other)
    expected = by_ray(*intersector.intersects_location(origins, directions, multiple_hits=False))
    row = "points, rays, triangles = mesh.ray.intersects_location(origins, directions, multiple_hits=False)"
    for found, other in zip(by_ray(*table.ours(row)), expected, strict=True):
        same(found, other)
    same(table.ours("mesh.contains(points)"), mesh.contains(points))
    with wive.trimesh.installed():  # trimesh needs SciPy for closest points
        row = "trimesh.proximity.closest_point(mesh, points)"
        for found, other in zip(table.ours(row), trimesh.proximity.closest_point(mesh, points), strict=True):
            same(found, other)
        row = "trimesh.proximity.signed_distance(mesh, points)"
        same(table.ours(row), trimesh.proximity.signed_distance(mesh, points))
    their_origins, their_directions, _ = view.camera_rays()
    origins, directions = table.ours("origins, directions, pixels = view.camera_rays()")
    assert directions.shape == (HEIGHT, WIDTH, 3)
    by_column = (array.transpose(1, 0, 2).reshape(-1, 3) for array in (origins, directions))
    for found, other in zip(by_column, (their_origins, their_directions), strict=True):
        same(
            found / np.linalg.norm(found, axis=1, keepdims=True),
            other / np.linalg.norm(other, axis=1)[:, None],
        )
    table.skip("trimesh.proximity.thickness(mesh, points)")
    table.expect_all_used()


@pytest.mark.parametrize("library", ["embreex", "wive.embreex"])
def test_embreex(library: str) -> None:
    module = pytest.importorskip(library)
    if library == "embreex":
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    else:
        rtcore_scene, TriangleMesh = module, module.TriangleMesh
    vertices, indices = tube()
    vertices, indices = vertices.astype(np.float32), indices.astype(np.int32)
    origins, directions = (array.astype(np.float32) for array in rays())
    distances = np.linspace(0.5, 3, len(origins)).astype(np.float32)
    table = Table("embreex, pyembree", {"origins": origins, "directions": directions, "d": distances})
    table.names |= {"vertices": vertices, "indices": indices}
    theirs = rtcore_scene.EmbreeScene()
    TriangleMesh(theirs, vertices, indices)
    table.ours("scene = rtcore_scene.EmbreeScene()")
    same(table.ours("scene.run(origins, directions)"), theirs.run(origins, directions))
    table.names["corners"] = vertices[indices]
    TriangleMesh(theirs := rtcore_scene.EmbreeScene(), vertices[indices])
    soup = table.ours("TriangleMesh(scene, corners)")
    same(soup.intersect(origins, directions).geom_prim, theirs.run(origins, directions))
    TriangleMesh(theirs := rtcore_scene.EmbreeScene(), vertices, indices)
    moved = vertices + np.float32([0, 0, 3])
    TriangleMesh(theirs, moved, indices)
    table.skip("TriangleMesh", "EmbreeScene(robust=True)")
    table.names["scene"] = wive.Scene.from_meshes([(vertices, indices), (moved, indices)])
    same(table.ours("scene.run(origins, directions)"), theirs.run(origins, directions))
    row = 'scene.run(origins, directions, query="OCCLUDED")'
    same(table.ours(row), theirs.run(origins, directions, query="OCCLUDED") == 0)
    row = 'scene.run(origins, directions, query="DISTANCE")'
    expected = theirs.run(origins, directions, query="DISTANCE")
    assert (expected[~table.names["scene"].intersect(origins, directions).mask] == np.float32(1e37)).all()
    same(table.ours(row), np.where(expected == np.float32(1e37), np.inf, expected))
    row = "scene.run(origins, directions, dists=d)"
    same(table.ours(row), theirs.run(origins, directions, dists=distances.copy()))
    expected = theirs.run(origins, directions, output=True)
    h = table.ours("scene.run(origins, directions, output=True)")
    hit = h.mask
    table.skip('["geomID"]', '["u"]')
    assert table.rows['["geomID"]'] == ["h.geom", "h.geom_prim", "h.t"]
    assert table.rows['["u"]'] == ["h.uv", "h.normals()"]
    for name, found in {"geomID": h.geom, "primID": h.geom_prim, "tfar": np.where(hit, h.t, 1e37)}.items():
        same(found, expected[name])
    same(h.uv[hit], np.c_[expected["u"], expected["v"]][hit])
    normals = expected["Ng"][hit] / np.linalg.norm(expected["Ng"][hit], axis=1, keepdims=True)
    same(h.normals()[hit], normals)
    table.expect_all_used()


def importable(name: str) -> Any:
    """The module; skips if it can't be imported, also for want of a system's library."""
    return pytest.importorskip(name, exc_type=ImportError)


@pytest.mark.filterwarnings("ignore")
def test_open3d() -> None:
    o3d = importable("open3d")
    vertices, faces = tube()
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces))
    theirs = o3d.t.geometry.RaycastingScene()
    theirs.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    origins, directions = (array.astype(np.float32).reshape(20, 10, 3) for array in rays())
    batch, points = np.concatenate([origins, directions], axis=-1), origins * np.float32(0.6)
    names = {"mesh": mesh, "rays": batch, "points": points, "origins": origins, "directions": directions}
    table = Table("Open3D", {**names, "tnear": 0.1, "tfar": 1.5, "width": WIDTH, "height": HEIGHT})
    table.rows["scene.add_triangles(mesh)"].pop()  # the list of several meshes
    table.ours("scene.add_triangles(mesh)")
    tensor = o3d.core.Tensor
    found, expected = table.ours("scene.cast_rays(rays)"), theirs.cast_rays(tensor(batch))
    hit = found.mask
    assert table.rows['["t_hit"]'] == ["hits.t", "hits.geom", "hits.geom_prim"]
    assert table.rows['["primitive_uvs"]'] == ["hits.uv", "hits.normals()"]
    table.skip('["t_hit"]', '["primitive_uvs"]', "nthreads=", "open3d.t.geometry.RaycastingScene")
    same(found.t, expected["t_hit"].numpy())
    pairs = {
        "geometry_ids": found.geom, "primitive_ids": found.geom_prim, "primitive_uvs": found.uv,
        "primitive_normals": found.normals(),
    }  # fmt: skip
    for name, ours in pairs.items():
        np.testing.assert_allclose(ours[hit], expected[name].numpy()[hit], atol=1e-5)
    same(
        table.ours("scene.test_occlusions(rays, tnear, tfar)"),
        theirs.test_occlusions(tensor(batch), 0.1, 1.5).numpy(),
    )
    same(table.ours("scene.count_intersections(rays)"), theirs.count_intersections(tensor(batch)).numpy())
    table.skip(row := "scene.list_intersections(rays)")
    creation, *parts = table.rows[row]
    assert (creation, parts) == (
        "a = scene.intersect_all(origins, directions)",
        ["a.offsets", "a.ray", "a.t"],
    )
    every, listed = (
        table.names["scene"].intersect_all(origins, directions),
        theirs.list_intersections(tensor(batch)),
    )
    same(every.offsets, listed["ray_splits"].numpy())
    ray, t = listed["ray_ids"].numpy(), listed["t_hit"].numpy()
    same(every.ray, ray)
    same(every.t, t[np.lexsort((t, ray))])
    table.ours(row := "scene.compute_closest_points(points)")
    same(table.names["c"].points(), theirs.compute_closest_points(tensor(points))["points"].numpy())
    assert table.rows[row][1:] == ["c.points()", "c.prim", "c.uv"]
    for call in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
        same(table.ours(f"scene.{call}(points)"), getattr(theirs, call)(tensor(points)).numpy())
    pinhole = o3d.t.geometry.RaycastingScene.create_rays_pinhole
    k, extrinsic = np.array([[9.0, 0, 7], [0, 8, 3], [0, 0, 1]]), np.eye(4)
    extrinsic[:3] = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]]
    intrinsic = k - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    table.names |= {"intrinsic": intrinsic, "extrinsic": extrinsic}
    row = "RaycastingScene.create_rays_pinhole(intrinsic, extrinsic, width, height)"
    same(np.concatenate(table.ours(row), axis=-1), pinhole(k, extrinsic, WIDTH, HEIGHT).numpy())
    (formula,) = re.findall(r"`fov = ([^`]+)`", section("Open3D"))
    table.names |= {"fov_deg": 60.0, "center": [0, 0, 0], "eye": [1, 2, 5], "up": [0, 1, 0]}
    table.names["fov"] = eval(formula, table.names)
    row = "RaycastingScene.create_rays_pinhole(fov_deg, center, eye, up, width, height)"
    _, ours = table.ours(row)
    turned = pinhole(60.0, [0, 0, 0], [1, 2, 5], [0, 1, 0], WIDTH, HEIGHT).numpy()[::-1, ::-1, 3:]
    same(*(array / np.linalg.norm(array, axis=-1, keepdims=True) for array in (ours, turned)))
    table.expect_all_used()


@pytest.mark.filterwarnings("ignore")
def test_pyvista() -> None:
    pyvista = importable("pyvista")
    vertices, faces = tube()
    mesh = pyvista.PolyData.from_regular_faces(vertices, faces)
    origins, directions = rays()
    a, b = np.array([-3.0, 0.1, 0.2]), np.array([3, 0.15, 0.1])
    grid = pyvista.PolyData(origins * 0.6)
    names = {"scene": wive.Scene(mesh), "a": a, "b": b, "origins": origins, "directions": directions}
    table = Table("PyVista", {**names, "points": origins * 0.6, "grid": grid})
    expected = by_ray(*mesh.ray_trace(a, b))
    for found, other in zip(
        by_ray(*table.ours("points, cells = mesh.ray_trace(a, b)")), expected, strict=True
    ):
        same(found, other)
    (nearest,) = table.ours("mesh.ray_trace(a, b, first_point=True)")
    same(nearest, min(mesh.ray_trace(a, b)[0].tolist(), key=lambda point: np.linalg.norm(point - a)))
    for row in (
        "points, rays, cells = mesh.multi_ray_trace(origins, directions)",
        "points, rays, cells = mesh.multi_ray_trace(origins, directions, first_point=True)",
    ):
        pytest.importorskip("rtree")
        call: Callable[..., Any] = mesh.multi_ray_trace
        expected = by_ray(*call(origins, directions, first_point="first_point" in row))
        for found, other in zip(by_ray(*table.ours(row)), expected, strict=True):
            same(found, other)
    inside = mesh_inside(grid, mesh)
    same(table.ours("grid.select_interior_points(mesh)"), inside)
    row = 'grid.compute_implicit_distance(mesh)["implicit_distance"]'
    same(table.ours(row), grid.compute_implicit_distance(mesh)["implicit_distance"])
    _, places = mesh.find_closest_cell(grid.points, return_closest_point=True)
    same(table.ours("mesh.find_closest_cell(points, return_closest_point=True)")[1], places)
    table.expect_all_used()


def mesh_inside(grid: Any, mesh: Any) -> np.ndarray:
    """Which points of the grid PyVista finds inside, under the name its version has for that."""
    if hasattr(grid, "select_interior_points"):
        return np.asarray(grid.select_interior_points(mesh)["selected_points"])
    return np.asarray(grid.select_enclosed_points(mesh)["SelectedPoints"])


@pytest.mark.slow
def test_warp(device: str) -> None:
    wp = pytest.importorskip("warp")
    from wive import warp_kernels as wk

    @wp.kernel(module="unique", enable_backward=False)
    def both(
        mesh: wp.uint64,
        bvh: wk.Bvh,
        origins: wp.array(dtype=wp.vec3),
        directions: wp.array(dtype=wp.vec3),
        theirs: wp.array2d(dtype=float),
        ours: wp.array2d(dtype=float),
    ):
        i = wp.tid()
        origin = origins[i]
        direction = directions[i]
        max_t = 3.0
        query = wp.mesh_query_ray(mesh, origin, direction, max_t)
        hit = wk.closest_hit(bvh, origin, direction, 0.0, max_t)
        ours[i, 0] = wp.where(hit.prim >= 0, 1.0, 0.0)
        theirs[i, 0] = wp.where(query.result, 1.0, 0.0)
        if hit.prim >= 0 and query.result:
            ours[i, 1] = float(hit.prim)
            theirs[i, 1] = float(query.face)
            ours[i, 2] = hit.t
            theirs[i, 2] = query.t
            ours[i, 3] = hit.u
            theirs[i, 3] = query.v
            ours[i, 4] = hit.v
            theirs[i, 4] = 1.0 - query.u - query.v
            ours[i, 5] = hit.normal[0]
            theirs[i, 5] = query.normal[0]
        ours[i, 6] = wp.where(wk.any_hit(bvh, origin, direction, 0.0, max_t), 1.0, 0.0)
        theirs[i, 6] = wp.where(wp.mesh_query_ray_anyhit(mesh, origin, direction, max_t), 1.0, 0.0)
        ours[i, 7] = float(wk.count_hits(bvh, origin, direction, 0.0, wp.inf))
        theirs[i, 7] = float(wp.mesh_query_ray_count_intersections(mesh, origin, direction))
        near = wp.mesh_query_point_no_sign(mesh, origin, 1.0)
        if near.result:
            theirs[i, 8] = wp.length(wp.mesh_eval_position(mesh, near.face, near.u, near.v) - origin)
        closest = wk.closest_point(bvh, origin, 1.0)
        if closest.prim >= 0:
            ours[i, 8] = closest.distance
        signed = wp.mesh_query_point_sign_winding_number(mesh, origin, 100.0)
        place = wp.mesh_eval_position(mesh, signed.face, signed.u, signed.v)
        theirs[i, 9] = signed.sign * wp.length(place - origin)

    vertices, faces = tube()
    vertices, faces = vertices.astype(np.float32), faces.astype(np.int32)
    scene = wive.Scene(vertices, faces, device=device)
    points = wp.array(vertices, dtype=wp.vec3, device=device)
    mesh = wp.Mesh(points, wp.array(faces.ravel(), dtype=int, device=device), support_winding_number=True)
    origins, directions = (wp.array(array, dtype=wp.vec3, device=device) for array in rays())
    theirs, ours = (wp.zeros((200, 10), dtype=float, device=device) for _ in range(2))
    inputs = [mesh.id, scene.tree.handle, origins, directions]
    wp.launch(both, 200, inputs, [theirs, ours], device=device)
    found, expected = ours.numpy(), theirs.numpy()
    found[:, 9] = scene.signed_distance(origins, sign="winding").numpy()
    for column in range(10):
        same(found[:, column], expected[:, column])
