"""`wive.Scene(mesh)` takes the meshes of other libraries, and says what is wrong with what is no mesh."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.meshes import random_rays, sphere

import wive

VERTICES, FACES = sphere(2)
RAYS = random_rays(300, seed=3, low=-1.5, high=1.5)


class Polygons:
    """A mesh as PyVista's PolyData has it."""

    def __init__(self, points, faces, strips=0):
        self.points, self.faces, self.n_strips = points, faces, strips
        self.n_cells = len(faces) + strips or 1


class Coordinates:
    """A mesh as trimesh has it: `triangles` are coordinates."""

    def __init__(self, vertices, faces):
        self.vertices, self.faces = vertices, faces
        self.triangles = vertices[faces]


class Triangles:
    """A mesh as Open3D has it."""

    def __init__(self, vertices, triangles):
        self.vertices, self.triangles = vertices, triangles


def padded(faces):
    """Faces as VTK has them."""
    return np.insert(faces, 0, 3, axis=1).ravel()


def tensors(vertices, faces):
    """A mesh as Open3D's tensor classes have it."""
    return SimpleNamespace(vertex={"positions": vertices}, triangle={"indices": faces})


class Tensor:
    """A tensor that only its own method converts."""

    def __init__(self, values):
        self.numpy = lambda: values


def shapes(vertices, faces):
    return {
        "vertices, faces": Coordinates(vertices, faces),
        "points, padded faces": Polygons(vertices, padded(faces)),
        "points, faces": Polygons(vertices, faces),
        "vertices, triangles": Triangles(vertices, faces),
        "tensors": tensors(vertices, faces),
        "tensors as attributes": SimpleNamespace(
            vertex=SimpleNamespace(positions=Tensor(vertices)),
            triangle=SimpleNamespace(indices=Tensor(faces)),
        ),
        "scene": wive.Scene(vertices, faces),
    }


def assert_same_scene(found, expected):
    assert found.precision == expected.precision
    np.testing.assert_array_equal(found.vertices, expected.vertices)
    np.testing.assert_array_equal(found.faces, expected.faces)
    mine, other = found.intersect(*RAYS), expected.intersect(*RAYS)
    assert other.mask.any()
    for name in ("t", "prim", "uv"):
        np.testing.assert_array_equal(getattr(mine, name), getattr(other, name))


@pytest.mark.parametrize("shape", shapes(VERTICES, FACES))
@pytest.mark.parametrize("kind", ["float32", "float64", "int64", ">f8", "Fortran"])
def test_a_mesh_object_makes_the_scene_of_its_arrays(shape, kind):
    vertices = np.asfortranarray(VERTICES) if kind == "Fortran" else VERTICES.astype(kind)
    if kind == "int64":
        vertices = np.round(VERTICES * 100).astype(kind)
    for faces in (FACES, FACES.astype(np.int64), FACES.astype(np.uint32), np.asfortranarray(FACES)):
        assert_same_scene(wive.Scene(shapes(vertices, faces)[shape]), wive.Scene(vertices, faces))


@pytest.mark.parametrize("shape", shapes(VERTICES, FACES))
def test_a_mesh_object_may_change_afterwards(shape):
    for dtype in (np.float32, np.float64):
        vertices, faces = VERTICES.astype(dtype), FACES.copy()
        mesh = shapes(vertices, faces)[shape]
        scene = wive.Scene(mesh)
        vertices += 1
        faces[:] = 0
        if hasattr(mesh, "points"):
            mesh.faces[:] = 0
        assert_same_scene(scene, wive.Scene(VERTICES.astype(dtype), FACES))


def test_arrays_are_still_kept():
    scene = wive.Scene(VERTICES, FACES)
    assert np.shares_memory(scene.vertices, VERTICES)
    assert np.shares_memory(scene.faces, FACES)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, "float32", "f8", np.dtype(float)])
@pytest.mark.parametrize("given", ["float32", "float64", "list", "object"])
def test_dtype_decides_the_precision(given, dtype):
    doubles = VERTICES.astype(np.float64) + 1e-9
    vertices = {"list": doubles.tolist(), "object": doubles}.get(given)
    vertices = doubles.astype(given) if vertices is None else vertices
    mesh = (Coordinates(vertices, FACES),) if given == "object" else (vertices, FACES)
    scene = wive.Scene(*mesh, dtype=dtype)
    name = np.dtype(dtype).name
    assert scene.precision == name
    assert f"precision={name!r}" in repr(scene)
    assert scene.vertices.dtype == scene.intersect(*RAYS).t.dtype == name
    np.testing.assert_array_equal(scene.vertices, np.asarray(vertices, np.float64).astype(name))


def test_exact_rounds_if_dtype_says_so():
    doubles = VERTICES.astype(np.float64) + 1e-9
    with pytest.raises(
        ValueError, match=r"got vertices\[\d+\] = .*: round them with dtype=np\.float32, or use"
    ):
        wive.Scene(Coordinates(doubles, FACES), accuracy="exact")
    for mesh in ((Coordinates(doubles, FACES),), (doubles, FACES), (doubles.tolist(), FACES)):
        scene = wive.Scene(*mesh, accuracy="exact", dtype=np.float32)
        assert_same_scene(scene, wive.Scene(doubles.astype(np.float32), FACES, accuracy="exact"))
    with pytest.raises(ValueError, match=r"^dtype must be float32 for accuracy 'exact', got float64"):
        wive.Scene(doubles, FACES, accuracy="exact", dtype=np.float64)
    with pytest.raises(ValueError, match=r"^dtype must be float32 or float64, got 'int'"):
        wive.Scene(doubles, FACES, dtype="int")


def test_numbers_beyond_float32_are_refused_by_their_vertex():
    vertices = VERTICES.astype(np.float64)
    vertices[7] = 1e300
    with pytest.raises(ValueError, match="7"):
        wive.Scene(vertices, FACES, dtype=np.float32)


POINTS = np.zeros((4, 3))


@pytest.mark.parametrize(
    ("mesh", "error", "message"),
    [
        (Polygons(POINTS, np.array([4, 0, 1, 2, 3])), ValueError, r"wive\.Scene\(mesh\.triangulate"),
        (Polygons(POINTS, np.array([4, 0, 1, 2])), ValueError, "must be triangles, got polygons"),
        (Polygons(POINTS, np.array([], int)), ValueError, "must be triangles, got none"),
        (Polygons(POINTS, padded([[0, 1, 2]]), strips=1), ValueError, "must be triangles, got polygons"),
        (Triangles(POINTS, [[0, 1]]), ValueError, r"faces must have shape \(f, 3\)"),
        (Triangles(POINTS, [[0, 1, 4]]), ValueError, "must index the 4 vertices from 0"),
        (Triangles(POINTS, [[0, 1, 2.5]]), TypeError, r"faces must be an \(f, 3\) array of integers"),
        (Triangles(POINTS, np.ones), TypeError, r"faces must be an \(f, 3\) array of integers, got function"),
        (Triangles(POINTS[:, :2], [[0, 1, 2]]), ValueError, r"must have shape \(v, 3\), got \(4, 2\)"),
        (Triangles(None, [[0, 1, 2]]), TypeError, "vertices must be .* numbers, got None"),
        (
            Triangles(np.ma.masked_array(POINTS, POINTS == 0), [[0, 1, 2]]),
            ValueError,
            "vertices must be .* got 12 that are masked",
        ),
        (tensors(POINTS, [[0, 1]]).vertex, TypeError, "the mesh must have vertices and faces, got dict"),
        (SimpleNamespace(vertex={}, triangle={}), TypeError, "got no positions"),
        (SimpleNamespace(vertices=POINTS), TypeError, r"got types\.SimpleNamespace: wive\.Scene\("),
        (Coordinates, TypeError, "got the class Coordinates"),
        ("mesh.ply", TypeError, r"got 'mesh\.ply' alone: wive\.Scene\.from_file reads files"),
        (POINTS, TypeError, "faces must be given with vertices, got an array alone"),
        ([[0, 0, 0]], TypeError, "faces must be given with vertices, got an array alone"),
        ([[0, 0, 0], [1, 0, 0]], TypeError, "faces must be given with vertices, got an array alone"),
        (np.zeros((5, 3, 3)), TypeError, r"got corners of triangles \(n, 3, 3\) alone: wive\.Scene\(corners"),
        ([(POINTS, FACES)] * 2, TypeError, r"a list of meshes: take wive\.Scene\.from_meshes\(meshes\)$"),
        ([(POINTS, FACES)], TypeError, r"a list of meshes: take wive\.Scene\.from_meshes\(meshes\)$"),
        ((wive.Scene(VERTICES, FACES), tensors(VERTICES, FACES)), TypeError, "got a list of meshes: take"),
        ((VERTICES, FACES), TypeError, r"got a tuple of both: wive\.Scene\(\*mesh\)"),
        (SimpleNamespace(vertex=3, triangle=3), TypeError, "got no positions"),
        (None, TypeError, "the mesh must have vertices and faces, got NoneType"),
        (SimpleNamespace(graph=0, geometry={}), TypeError, r"take wive\.Scene\.from_meshes\(mesh\)$"),
        (SimpleNamespace(extract_surface=0), TypeError, r"\.extract_surface\(\)\.triangulate\("),
    ],
)  # fmt: skip
def test_what_is_no_triangle_mesh_is_refused_in_one_line(mesh, error, message):
    with pytest.raises(error, match=message) as raised:
        wive.Scene(mesh)
    assert "\n" not in str(raised.value)


def test_meshes_of_trimesh_are_taken_and_its_scenes_refused():
    trimesh = pytest.importorskip("trimesh")
    box, ball = trimesh.creation.box(), trimesh.primitives.Sphere()
    for mesh in (box, ball, trimesh.Trimesh(), box + ball):
        scene = wive.Scene(mesh)
        assert scene.precision == "float64"
        np.testing.assert_array_equal(scene.vertices, np.asarray(mesh.vertices))
        np.testing.assert_array_equal(scene.faces, np.asarray(mesh.faces))
        assert type(scene.vertices) is type(scene.faces) is np.ndarray
    several = trimesh.Scene([box, ball])
    with pytest.raises(
        TypeError, match=r"got a trimesh\.Scene: take wive\.Scene\.from_meshes\(mesh\)$"
    ) as raised:
        wive.Scene(several)
    way = str(raised.value).rpartition(": take ")[2]
    assert len(eval(way, {"wive": wive, "mesh": several})) == len(box.faces) + len(ball.faces)
    with pytest.raises(TypeError, match=r"must have vertices and faces, got trimesh\.PointCloud"):
        wive.Scene(trimesh.PointCloud(POINTS))


def test_meshes_of_pyvista_are_taken():
    pyvista = pytest.importorskip("pyvista", exc_type=ImportError)
    for dtype in (np.float32, np.float64):
        mesh = pyvista.PolyData(VERTICES.astype(dtype), padded(FACES))
        assert_same_scene(wive.Scene(mesh), wive.Scene(VERTICES.astype(dtype), FACES))
    with pytest.raises(ValueError, match=r"faces of a pyvista\.PolyData must be triangles, got polygons"):
        wive.Scene(pyvista.Cube())
    assert len(wive.Scene(pyvista.Cube().triangulate())) == 12
    for mesh in (pyvista.PolyData(POINTS), pyvista.Line(), pyvista.Sphere().strip()):
        with pytest.raises(ValueError, match="must be triangles"):
            wive.Scene(mesh)
    with pytest.raises(TypeError, match=r"wive\.Scene\(mesh\.extract_surface\(\)\.triangulate\(\)\)"):
        wive.Scene(pyvista.ImageData(dimensions=(3, 3, 3)))


def test_meshes_of_open3d_are_taken():
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(VERTICES.astype(float)), open3d.utility.Vector3iVector(FACES)
    )
    scene = wive.Scene(mesh)
    mesh.translate([5, 0, 0])
    assert_same_scene(scene, wive.Scene(VERTICES.astype(float), FACES))
    for dtype in (np.float32, np.float64):
        vertices = VERTICES.astype(dtype)
        mesh = open3d.t.geometry.TriangleMesh(open3d.core.Tensor(vertices), open3d.core.Tensor(FACES))
        assert_same_scene(wive.Scene(mesh), wive.Scene(vertices, FACES))
    rays = [open3d.core.Tensor(np.ascontiguousarray(rows)) for rows in RAYS]
    np.testing.assert_array_equal(scene.intersect(*rays).t, scene.intersect(*RAYS).t)
    with pytest.raises(TypeError, match="got no positions"):
        wive.Scene(open3d.t.geometry.TriangleMesh())
    with pytest.raises(TypeError, match=r"must have vertices and faces, got open3d\.PointCloud"):
        wive.Scene(open3d.geometry.PointCloud())
