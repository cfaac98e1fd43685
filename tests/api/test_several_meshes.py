"""Scenes of several meshes: their hits are the nearest of those in scenes of one mesh each."""

import copy
import json
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import random_rays, soup, sphere

import wive
from wive._internal import storage

SPHERE = sphere(2)
EMPTY = np.empty((0, 3), np.float32), np.empty((0, 3), np.int32)


def meshes(dtype: type = np.float32) -> list[tuple[np.ndarray, np.ndarray]]:
    """Meshes that overlap, an empty one first, last and between them, and two that coincide."""
    some = soup(60, seed=1), EMPTY, SPHERE, EMPTY, EMPTY, soup(40, seed=2), SPHERE
    return [(vertices.astype(dtype), faces) for vertices, faces in (EMPTY, *some, EMPTY)]


RAYS = random_rays(2000, seed=3)


def nearest(given, rays, **options):
    """t, mesh and triangle of the nearest hit in scenes of one mesh each, of the first mesh at equal t."""
    alone = [wive.Scene(*mesh, **options).intersect(*rays) for mesh in given]
    t = np.array([hits.t for hits in alone])
    geom = np.argmin(t, axis=0)
    rows = geom, np.arange(t.shape[1])
    prim = np.array([hits.prim for hits in alone])[rows]
    return t[rows], np.where(np.isinf(t[rows]), -1, geom), prim


def assert_hits_are(hits, t, geom, prim):
    assert len(np.unique(geom)) > 3
    for array in (hits.geom, hits.geom_prim):
        assert array.dtype == np.int32
    for found, expected in ((hits.t, t), (hits.geom, geom), (hits.geom_prim, prim)):
        np.testing.assert_array_equal(np.asarray(found), expected)


@pytest.mark.parametrize(
    ("accuracy", "dtype"),
    [("fast", np.float32), ("exact", np.float32), ("watertight", np.float32), ("watertight", np.float64)],
)
def test_hits_are_the_nearest_of_those_of_each_mesh(backend, accuracy, dtype):
    given, options = meshes(dtype), {"backend": backend, "accuracy": accuracy}
    scene = wive.Scene.from_meshes(given, **options)
    hits = scene.intersect(*RAYS)
    assert_hits_are(hits, *nearest(given, RAYS, **options))
    np.testing.assert_array_equal(hits.geom >= 0, hits.mask)


@pytest.mark.parametrize("query", ["intersect", "intersect_all"])
def test_one_ray_has_the_mesh_it_has_among_others(backend, query):
    scene = wive.Scene.from_meshes(meshes(), backend=backend)
    every = getattr(scene, query)(*RAYS)
    hit = (every.mask if query == "intersect" else every.counts > 0).nonzero()[0][:20]
    for ray in hit:
        origins, directions = (rows[ray : ray + 1] for rows in RAYS)
        for one in (
            getattr(scene, query)(origins, directions),
            getattr(scene, query)(origins[0].tolist(), directions[0].tolist()),
        ):
            expected = slice(ray, ray + 1) if query == "intersect" else slice(*every.offsets[ray : ray + 2])
            np.testing.assert_array_equal(one.geom, every.geom[expected])
            np.testing.assert_array_equal(one.geom_prim, every.geom_prim[expected])
    assert len(hit) == 20


def test_prim_is_the_row_of_the_scenes_faces():
    given = meshes()
    scene = wive.Scene.from_meshes(given)
    hits = scene.intersect(*RAYS)
    hit = np.nonzero(hits.mask)[0]
    for ray in hit[:50]:
        vertices, faces = given[hits.geom[ray]]
        corners = vertices[faces[hits.geom_prim[ray]]]
        np.testing.assert_array_equal(scene.vertices[scene.faces[hits.prim[ray]]], corners)
    at = hits.interpolate(scene.vertices)
    np.testing.assert_allclose(at[hit], hits.points()[hit], atol=1e-6)


def test_offsets_slice_the_meshes_as_they_were_given():
    given = meshes()
    scene = wive.Scene.from_meshes(given)
    assert len(scene.geoms) == len(given)
    assert scene.geoms.faces.dtype == scene.geoms.vertices.dtype == np.int32
    for i, (vertices, faces) in enumerate(given):
        first, last = scene.geoms.faces[i : i + 2]
        start, end = scene.geoms.vertices[i : i + 2]
        np.testing.assert_array_equal(scene.vertices[start:end], vertices)
        np.testing.assert_array_equal(scene.faces[first:last] - start, faces)
    with pytest.raises(ValueError, match="read-only"):
        scene.geoms.faces[0] = 1
    with pytest.raises(AttributeError, match="can't be set"):
        scene.geoms.faces = 1


@pytest.mark.parametrize("make", [wive.Scene, lambda *mesh: wive.Scene.from_meshes([mesh])])
def test_a_scene_of_one_mesh_has_mesh_0(backend, make):
    scene = make(*SPHERE)
    hits = scene.intersect(*RAYS)
    assert len(scene.geoms) == 1
    assert scene.geoms.faces.tolist() == [0, len(SPHERE[1])]
    assert scene.geoms.vertices.tolist() == [0, len(SPHERE[0])]
    np.testing.assert_array_equal(hits.geom, np.where(hits.mask, 0, -1))
    np.testing.assert_array_equal(hits.geom_prim, hits.prim)
    assert "meshes" not in repr(scene)
    scene.refit(SPHERE[0] * 2, geom=0)
    np.testing.assert_array_equal(scene.vertices, SPHERE[0] * 2)


def test_meshes_without_triangles_are_never_hit(backend):
    hits = wive.Scene.from_meshes([EMPTY, EMPTY], backend=backend).intersect(*RAYS)
    for array in (hits.geom, hits.geom_prim, hits.prim):
        assert (np.asarray(array) == -1).all()


def test_every_hit_has_its_mesh(backend):
    given = meshes()
    scene = wive.Scene.from_meshes(given, backend=backend)
    every = scene.intersect_all(*RAYS)
    alone = [wive.Scene(*mesh, backend=backend).intersect_all(*RAYS) for mesh in given]
    expected = sorted(
        (int(ray), float(t), i, int(prim))
        for i, hits in enumerate(alone)
        for ray, t, prim in zip(hits.ray, hits.t, hits.prim, strict=True)
    )
    arrays = every.ray, every.t, every.geom, every.geom_prim
    assert [tuple(row) for row in zip(*(array.tolist() for array in arrays), strict=True)] == expected
    one = every[7]
    np.testing.assert_array_equal(one.geom, every.geom[every.offsets[7] : every.offsets[8]])
    np.testing.assert_array_equal(one.geom_prim, every.geom_prim[every.offsets[7] : every.offsets[8]])
    assert len(one.geom) > 0
    assert set(every.geom.tolist()) == {1, 3, 6, 7}


def test_rays_of_any_shape_have_meshes_of_that_shape(backend):
    scene = wive.Scene.from_meshes(meshes(), backend=backend)
    flat = scene.intersect(*RAYS)
    shaped = scene.intersect(*(rows.reshape(40, 50, 3) for rows in RAYS))
    for again in (shaped, copy.copy(shaped), pickle.loads(pickle.dumps(shaped))):
        assert again.geom.shape == again.geom_prim.shape == (40, 50)
        np.testing.assert_array_equal(again.geom.ravel(), flat.geom)
        np.testing.assert_array_equal(again.geom_prim.ravel(), flat.geom_prim)


@pytest.mark.parametrize("query", ["intersect", "intersect_all"])
def test_hits_keep_their_meshes_in_pickles(query):
    hits = getattr(wive.Scene.from_meshes(meshes()), query)(*RAYS)
    for again in (pickle.loads(pickle.dumps(hits)), copy.deepcopy(hits)):
        np.testing.assert_array_equal(again.geom, hits.geom)
        np.testing.assert_array_equal(again.geom_prim, hits.geom_prim)


@pytest.mark.parametrize("query", ["intersect", "intersect_all"])
def test_meshes_come_in_arrays_of_the_rays_library(backend, query):
    scene = wive.Scene.from_meshes(meshes(), backend=backend)
    expected = getattr(scene, query)(*RAYS)
    if backend != "warp":
        found = getattr(scene, query)(*(Foreign.Array(rows) for rows in RAYS))
        assert type(found.geom) is type(found.geom_prim) is Foreign.Array
        np.testing.assert_array_equal(found.geom.values, expected.geom)
        np.testing.assert_array_equal(found.geom_prim.values, expected.geom_prim)
    torch = pytest.importorskip("torch")
    rays = [torch.from_numpy(rows).to(scene.device or "cpu") for rows in RAYS]
    found = getattr(scene, query)(*rays)
    for name in ("geom", "geom_prim"):
        assert getattr(found, name).dtype == torch.int32
        assert getattr(found, name).device == found.prim.device
        np.testing.assert_array_equal(getattr(found, name).cpu().numpy(), getattr(expected, name))


@pytest.mark.parametrize("several", [True, False])
def test_warp_arrays_have_meshes_on_their_device(device, several):
    wp = pytest.importorskip("warp")
    scene = wive.Scene.from_meshes(meshes() if several else [SPHERE], device=device)
    rays = [wp.array(rows, dtype=wp.vec3, device=device) for rows in RAYS]
    for query in ("intersect", "intersect_all"):
        found, expected = getattr(scene, query)(*rays), getattr(scene, query)(*RAYS)
        for name in ("geom", "geom_prim"):
            array = getattr(found, name)
            assert isinstance(array, wp.array) and array.dtype == wp.int32
            assert str(array.device) == device
            np.testing.assert_array_equal(array.numpy(), getattr(expected, name))
    part = scene.intersect_all(*rays)[7]
    np.testing.assert_array_equal(part.geom.numpy(), expected[7].geom)


def test_refit_moves_one_mesh(backend):
    given = meshes()
    scene = wive.Scene.from_meshes(given, backend=backend)
    before = scene.intersect(*RAYS)
    kept, geoms = before.points(), before.geom
    for i, step in ((3, 0.25), (6, -0.5), (3, 0.75), (0, 0)):
        given[i] = given[i][0] + np.float32(step), given[i][1]
        scene.refit(given[i][0], geom=i)
        assert_hits_are(scene.intersect(*RAYS), *nearest(given, RAYS, backend=backend))
    np.testing.assert_array_equal(before.points(), kept)
    np.testing.assert_array_equal(before.geom, geoms)
    moved = [vertices * np.float32(0.5) for vertices, _ in given]
    scene.refit(np.concatenate(moved))
    assert_hits_are(scene.intersect(*RAYS), *nearest([*zip(moved, (f for _, f in given), strict=True)], RAYS))


@pytest.mark.parametrize(
    ("vertices", "geom", "error", "message"),
    [
        (SPHERE[0], 9, ValueError, r"^geom must be from 0 to 8, got 9$"),
        (SPHERE[0], -1, ValueError, r"^geom must be from 0 to 8, got -1$"),
        (SPHERE[0], 3.0, TypeError, r"^geom must be an integer, got"),
        (SPHERE[0], True, TypeError, r"^geom must be an integer, got"),
        (SPHERE[0][1:], 3, ValueError, r"must have shape \(162, 3\), as those of mesh 3, got \(161, 3\)"),
        (SPHERE[0], 2, ValueError, r"must have shape \(0, 3\), as those of mesh 2, got \(162, 3\)"),
        (np.full((162, 3), np.inf), 3, ValueError, r"^vertices\[0\] = \(inf, inf, inf\)"),
        (np.where(np.arange(162)[:, None] == 7, np.nan, SPHERE[0]), 3, ValueError, r"^vertices\[7\] = "),
        (np.ma.masked_array(SPHERE[0], SPHERE[0] > 0), 3, ValueError, "^vertices must be .* masked"),
    ],
)
def test_a_refit_that_cannot_be_leaves_the_scene(vertices, geom, error, message):
    scene = wive.Scene.from_meshes(meshes())
    before = scene.vertices.copy()
    with pytest.raises(error, match=message) as raised:
        scene.refit(vertices, geom=geom)
    assert "\n" not in str(raised.value)
    np.testing.assert_array_equal(scene.vertices, before)


def test_float64_vertices_of_one_mesh_make_a_float64_scene():
    fine = 0.1 + 1e-9
    listed = [[fine, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    doubles = SPHERE[0].astype(np.float64) + 1e-9
    make = wive.Scene.from_meshes
    assert make([SPHERE, listed]).precision == "float32"
    scene = make([SPHERE, listed, (doubles, SPHERE[1])])
    assert scene.precision == "float64"
    assert scene.vertices[len(SPHERE[0]), 0] == fine
    np.testing.assert_array_equal(scene.vertices[-162:], doubles)
    assert make([SPHERE, (doubles, SPHERE[1])], dtype=np.float32).precision == "float32"
    assert make([SPHERE, listed], dtype=np.float64).vertices[len(SPHERE[0]), 0] == fine
    exact = make([SPHERE, (doubles, SPHERE[1])], dtype=np.float32, accuracy="exact")
    assert (exact.precision, exact.accuracy) == ("float32", "exact")
    with pytest.raises(ValueError, match=r"^meshes\[1\]: vertices must be float32 numbers .* got vert"):
        make([SPHERE, (doubles, SPHERE[1])], accuracy="exact")
    with pytest.raises(ValueError, match=r"^dtype must be float32 for accuracy 'exact'"):
        make([SPHERE], accuracy="exact", dtype=np.float64)


def test_meshes_are_copied():
    for count in (1, 2):
        given = [(SPHERE[0].copy(), SPHERE[1].copy()) for _ in range(count)]
        scene = wive.Scene.from_meshes(given)
        for vertices, faces in given:
            assert not np.shares_memory(scene.vertices, vertices)
            assert not np.shares_memory(scene.faces, faces)


def test_items_are_pairs_and_mesh_objects_of_any_iterable():
    vertices, faces = SPHERE
    kinds = [
        (vertices, faces),
        [vertices.tolist(), faces.tolist()],
        SimpleNamespace(vertices=vertices, triangles=faces),
        SimpleNamespace(points=vertices, faces=np.insert(faces, 0, 3, axis=1).ravel()),
        wive.Scene(vertices, faces),
        (Foreign.Array(vertices), Foreign.Array(faces.astype(np.int64))),
    ]
    for given in (kinds, tuple(kinds), iter(kinds), dict(enumerate(kinds)).values()):
        scene = wive.Scene.from_meshes(given)
        assert len(scene.geoms) == len(kinds)
        np.testing.assert_array_equal(scene.vertices, np.tile(vertices, (len(kinds), 1)))
        assert repr(scene).startswith(f"Scene({6 * len(faces)} triangles in 6 meshes, backend=")


def bad(vertices: object = SPHERE[0], faces: object = SPHERE[1]) -> list[object]:
    return [SPHERE, EMPTY, (vertices, faces)]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ([], ValueError, "^meshes must be at least one mesh, got none"),
        (iter(()), ValueError, "^meshes must be at least one mesh, got none"),
        (None, TypeError, "^meshes must be a list of meshes, .* got NoneType"),
        ("a.ply", TypeError, r"^meshes must be a list .* got 'a\.ply': wive\.load_mesh reads files$"),
        ({"a": SPHERE}, TypeError, r"^meshes must be a list .* got a dict: take its values\(\)$"),
        (SPHERE[0], TypeError, r"^meshes must be a list .* got an array alone: \[\(vertices, faces\)\]"),
        (wive.Scene(*SPHERE), TypeError, r"got wive\.Scene: wive\.Scene takes one mesh$"),
        (SPHERE, TypeError, r"^meshes\[0\]: expected \(vertices, faces\) or a mesh object, got an array"),
        ([SPHERE, (*SPHERE, 3)], TypeError, r"^meshes\[1\]: expected .* got a tuple of 3$"),
        ([SPHERE, ()], TypeError, r"^meshes\[1\]: expected .* got a tuple of 0$"),
        ([SPHERE, "a.ply"], TypeError, r"^meshes\[1\]: expected .* got 'a\.ply': wive\.load_mesh reads"),
        ([SPHERE, None], TypeError, r"^meshes\[1\]: the mesh must have vertices and faces, got NoneType"),
        (
            [SPHERE, SimpleNamespace(geometry={}, graph=0)],
            TypeError,
            r"^meshes\[1\]: the mesh must be one triangle mesh, .* take wive\.Scene\.from_meshes\(mesh\)$",
        ),
        (bad(faces=SPHERE[1] + 1), ValueError, r"^meshes\[2\]: faces must index the 162 vertices from 0"),
        (bad(faces=SPHERE[1] - 1), ValueError, r"^meshes\[2\]: faces must index the 162 vertices from 0"),
        (
            bad(faces=SPHERE[1].astype(np.int64) + 2**40),
            ValueError,
            r"^meshes\[2\]: faces must index the 162 vertices",
        ),
        (bad(faces=SPHERE[1].astype(float)), TypeError, r"^meshes\[2\]: faces must be an \(f, 3\) array"),
        (bad(SPHERE[0][:, :2]), ValueError, r"^meshes\[2\]: vertices must have shape \(v, 3\), got"),
        (bad(np.full((162, 3), np.inf)), ValueError, r"^meshes\[2\]: vertices\[0\] = "),
        (bad(np.where(SPHERE[0] > 0.9, np.nan, SPHERE[0])), ValueError, r"^meshes\[2\]: vertices\[\d+\] ="),
        (bad(SPHERE[0] * 1e19), ValueError, r"^meshes\[2\]: vertices\[\d+\] = "),
        (
            bad(np.ma.masked_array(SPHERE[0], SPHERE[0] > 0)),
            ValueError,
            r"^meshes\[2\]: vertices must be .* that are masked",
        ),
        (
            bad(faces=np.ma.masked_array(SPHERE[1], SPHERE[1] > 9)),
            ValueError,
            r"^meshes\[2\]: faces must be .* that are masked",
        ),
        (bad(Foreign.Array(SPHERE[0], (2, 0))), ValueError, r"^meshes\[2\]: vertices must be in host memory"),
    ],
)
def test_what_is_no_list_of_meshes_is_refused_by_number(given, error, message):
    with pytest.raises(error, match=message) as raised:
        wive.Scene.from_meshes(given)
    assert "\n" not in str(raised.value)


def test_faces_that_index_another_meshs_vertices_are_refused():
    with pytest.raises(ValueError, match=r"^meshes\[0\]: faces must index the 162 vertices from 0"):
        wive.Scene.from_meshes([(SPHERE[0], SPHERE[1] + 100), SPHERE])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"accuracy": "best"}, "^accuracy"),
        ({"backend": "gpu"}, "^backend"),
        ({"dtype": int}, "^dtype"),
    ],
)
def test_bad_options_are_named_as_by_scene(options, message):
    with pytest.raises(ValueError, match=message):
        wive.Scene.from_meshes([SPHERE, SPHERE], **options)


def test_faces_beside_the_meshes_are_refused():
    with pytest.raises(TypeError, match="argument 'faces'"):
        wive.Scene.from_meshes([SPHERE, SPHERE], faces=SPHERE[1])


def test_saved_and_pickled_scenes_keep_their_meshes(tmp_path):
    path = tmp_path / "scene.wive"
    given = meshes(np.float64)
    scene = wive.Scene.from_meshes(given, accuracy="fast", nodes="compressed")
    scene.refit(given[3][0] + 0.25, geom=3)
    scene.save(path)
    hits = scene.intersect(*RAYS)
    for again in (wive.load(path), pickle.loads(pickle.dumps(scene)), copy.copy(scene)):
        assert repr(again).startswith(repr(scene)[:-1])
        found = again.intersect(*RAYS)
        for name in ("t", "prim", "geom", "geom_prim"):
            np.testing.assert_array_equal(getattr(found, name), getattr(hits, name))
        again.refit(given[3][0], geom=3)
    np.testing.assert_array_equal(hits.t, scene.intersect(*RAYS).t)


def test_wives_that_know_one_mesh_alone_refuse_several(tmp_path, monkeypatch):
    path, several = tmp_path / "scene.wive", wive.Scene.from_meshes([SPHERE, SPHERE])
    pickled = pickle.dumps(several)
    several.save(path)
    monkeypatch.setattr(storage, "OPTIONS", frozenset(storage.Options.__annotations__))
    for read in (lambda: wive.load(path), lambda: pickle.loads(pickled)):
        with pytest.raises(ValueError, match=r"with unknown options \(geoms\), .* upgrade wive"):
            read()
    for one in (wive.Scene(*SPHERE), wive.Scene.from_meshes([SPHERE])):
        one.save(path)
        assert len(wive.load(path)) == len(pickle.loads(pickle.dumps(one))) == len(SPHERE[1])


@pytest.mark.parametrize(
    "offsets",
    [
        None,
        np.int32([[0, 320, 640]]),
        np.int32([[0, 320, 640], [0, 400, 324]]),
        np.int32([[0, 320, 641], [0, 162, 324]]),
        np.int32([[1, 320, 640], [0, 162, 324]]),
        np.int32([[0, 320, 640], [0, 162, 323]]),
        np.int32([[], []]),
        np.int32(0),
        np.float64([[0, 320, 640], [0, 162, 324]]),
    ],
)
def test_damaged_offsets_are_no_scene(tmp_path, offsets):
    path = tmp_path / "scene.npz"
    wive.Scene.from_meshes([SPHERE, SPHERE]).save(path)
    with np.load(path) as file:
        arrays = dict(file)
    assert json.loads(str(arrays["header"]))["options"]["geoms"] == 2
    assert arrays.pop("geoms").tolist() == [[0, 320, 640], [0, 162, 324]]
    if offsets is not None:
        arrays["geoms"] = (
            np.asarray(offsets) if isinstance(offsets, np.ndarray) else np.array(offsets, np.int32)
        )
    with open(path, "wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(ValueError, match="not a scene saved by wive") as raised:
        wive.load(path)
    assert "\n" not in str(raised.value)


def placed(*nodes: tuple[str, np.ndarray], **geometry: object) -> SimpleNamespace:
    """A scene as trimesh has it, of nodes (name of the mesh, matrix)."""
    graph = type("Graph", (dict,), {"nodes_geometry": property(lambda self: list(self))})
    places = {f"node {i}": (matrix, name) for i, (name, matrix) in enumerate(nodes)}
    return SimpleNamespace(geometry=geometry, graph=graph(places))


def test_the_nodes_of_a_placed_scene_are_its_meshes():
    vertices, faces = SPHERE
    turned = np.array([[0, -2, 0, 5.1], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]])
    mirror = np.diag([-1.0, 1, 1, 1])
    ball, cloud = SimpleNamespace(vertices=vertices, faces=faces), SimpleNamespace(vertices=vertices)
    nodes = ("ball", np.eye(4)), ("cloud", np.eye(4)), ("ball", turned), ("ball", mirror)
    scene = wive.Scene.from_meshes(placed(*nodes, ball=ball, cloud=cloud))
    assert scene.precision == "float64"
    assert scene.geoms.faces.tolist() == [0, 320, 320, 640, 960]
    doubles = vertices.astype(np.float64)
    for i, expected in (
        (0, doubles),
        (2, doubles @ turned[:3, :3].T + turned[:3, 3]),
        (3, doubles * (-1, 1, 1)),
    ):
        start, end = scene.geoms.vertices[i : i + 2]
        np.testing.assert_allclose(scene.vertices[start:end], expected, rtol=0, atol=1e-15)
    hits = scene.intersect([[5.1, 0, 9], [9, 9, 9]], [0, 0, -1])
    assert hits.geom.tolist() == [2, -1]
    outside = scene.spawn(np.arange(960), (1 / 3, 1 / 3), (0, 0, 1))
    corners = scene.vertices[scene.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centres = corners.mean(axis=1) - np.repeat([[0, 0, 0], [5.1, 0, 0], [0, 0, 0]], 320, axis=0)
    assert (np.sum(normals * centres, axis=1) > 0).all()  # also of the mirrored one
    assert np.isfinite(outside).all()


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (placed(), r"^meshes must be at least one mesh, got a types\.SimpleNamespace that places none$"),
        (
            placed(("m", np.eye(4)), ("m", np.ones((4, 4))), m=wive.Scene(*SPHERE)),
            r"^meshes\[1\]: transform of node 'node 1': expected finite numbers and a last row of 0 0 0 1",
        ),
        (
            placed(("m", np.eye(4)), m=SimpleNamespace(vertices=SPHERE[0], faces=SPHERE[1] + 1)),
            r"^meshes\[0\]: faces must index the 162 vertices from 0",
        ),
    ],
)
def test_placed_scenes_that_cannot_be_are_refused(scene, message):
    with pytest.raises(ValueError, match=message):
        wive.Scene.from_meshes(scene)


def test_scenes_of_trimesh_are_taken_with_their_places():
    trimesh = pytest.importorskip("trimesh")
    box, ball = trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=2)
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [4, 5, 6])
    given = trimesh.Scene([box])
    given.add_geometry(ball, transform=turn)
    given.add_geometry(trimesh.PointCloud(ball.vertices))
    given.add_geometry(box, transform=trimesh.transformations.scale_matrix(-2))
    scene, merged = wive.Scene.from_meshes(given), given.to_mesh()
    assert len(scene.geoms) == len(given.graph.nodes_geometry) == 4
    assert np.diff(scene.geoms.faces).tolist() == [12, 320, 0, 12]
    np.testing.assert_allclose(scene.vertices, merged.vertices, rtol=0, atol=1e-14)
    rays = random_rays(500, seed=5, low=-3, high=3)
    expected, hits = wive.Scene(merged).intersect(*rays), scene.intersect(*rays)
    assert expected.mask.any()
    np.testing.assert_array_equal(hits.mask, expected.mask)
    np.testing.assert_allclose(hits.t, expected.t, rtol=1e-9)
    np.testing.assert_allclose(hits.normals(), expected.normals(), rtol=0, atol=1e-9)
