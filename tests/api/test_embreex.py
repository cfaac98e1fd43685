"""`wive.embreex` gives embreex's own results if these are right, without its defects."""

import numpy as np
import pytest
from support.meshes import all_crossings, random_rays, soup, sphere

import wive
from wive.embreex import ElementMesh, EmbreeDevice, EmbreeScene, TriangleMesh

QUERIES = "INTERSECT", "DISTANCE", "OCCLUDED"
DOWN = np.array([[0, 0, -1]], np.float32)


def stacked(heights, mesh=TriangleMesh, scene=None):
    """A scene of triangles above each other, one per mesh."""
    scene = EmbreeScene() if scene is None else scene
    for z in heights:
        mesh(scene, np.array([[[0, 0, z], [1, 0, z], [0, 1, z]]], np.float32))
    return scene


def above(*heights):
    """Origins of rays that meet those triangles within."""
    return np.array([[0.25, 0.25, z] for z in heights], np.float32)


def same_scenes(add, robust=True):
    """The same scene of embreex and of wive; skips if embreex is not installed."""
    pytest.importorskip("embreex")
    from embreex import mesh_construction, rtcore_scene

    theirs, ours = rtcore_scene.EmbreeScene(robust=robust), EmbreeScene(robust=robust)
    add(theirs, mesh_construction)
    add(ours, wive.embreex.mesh_construction)
    return theirs, ours


def clear_rays(vertices, faces, count, seed):
    """Rays that pass no edge closely, with room between hits."""
    origins, directions = random_rays(count, seed, low=-0.5, high=1.5)
    t, clear = all_crossings(vertices, faces, origins, directions)
    farthest = np.where(np.isfinite(t), t, 1e9 * (1 + np.arange(len(faces))))
    kept = (clear.min(axis=1) > 1e-3) & (np.diff(np.sort(farthest, axis=1), axis=1).min(axis=1) > 1e-3)
    return origins[kept], directions[kept]


def assert_same(mine, other):
    for name in mine if isinstance(mine, dict) else ("",):
        ours, theirs = (found[name] if name else found for found in (mine, other))
        assert ours.dtype == theirs.dtype
        assert ours.shape == theirs.shape
        if name in ("u", "v", "Ng"):  # embreex leaves them as they are on a miss
            hit = other["primID"] >= 0
            assert hit.any() and not ours[~hit].any()
            ours, theirs = ours[hit], theirs[hit]
        np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-4)
    if isinstance(mine, dict):
        assert mine.keys() == other.keys()


@pytest.mark.parametrize("robust", [True, False])
@pytest.mark.parametrize("dists", ["none", "number", "array"])
def test_hits_are_those_of_embreex(robust, dists):
    vertices, faces = soup(60, seed=1, size=0.3)

    def add(scene, module):
        module.TriangleMesh(scene, vertices[faces[:20]])
        module.TriangleMesh(scene, vertices, faces[20:21].astype(np.uint32))
        module.TriangleMesh(scene, vertices.astype(float), faces[21:].astype(np.int64))

    theirs, ours = same_scenes(add, robust)
    origins, directions = clear_rays(vertices, faces, 1500, seed=2)
    random = np.random.default_rng(3)
    limit = {"none": None, "number": 0.3, "array": random.uniform(0, 1, len(origins)).astype(np.float32)}[
        dists
    ]
    for query in QUERIES:
        found = ours.run(origins, directions, limit, query)
        assert_same(found, theirs.run(origins, directions, None if limit is None else limit + 0, query))
        assert len(np.unique(found)) > 1
        if query != "OCCLUDED":
            given = {"dists": limit, "query": query, "output": True}
            found = ours.run(origins, directions, **given)
            given["dists"] = None if limit is None else limit + 0
            assert set(found["geomID"]) == {-1, 0, 1, 2}
            assert_same(found, theirs.run(origins, directions, **given))
    shared = directions[:1]
    for query in QUERIES:
        assert_same(ours.run(origins, shared, query=query), theirs.run(origins, shared, query=query))


@pytest.mark.parametrize("corners", [4, 8])
def test_elements_are_those_of_embreex(corners):
    vertices = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], np.float32
    )
    elements = np.array([[0, 1, 3, 4], [6, 5, 7, 2]] if corners == 4 else [range(8)], np.uint32)
    theirs, ours = same_scenes(lambda scene, module: module.ElementMesh(scene, vertices, elements))
    faces = ours.scene.faces
    origins, directions = clear_rays(vertices, faces, 2000, seed=4)
    found = ours.run(origins, directions, output=True)
    assert_same(found, theirs.run(origins, directions, output=True))
    assert set(found["primID"]) == {-1, *range(len(faces))}


@pytest.mark.parametrize("robust", [True, False])
def test_a_ray_that_starts_on_a_triangle_hits_it_as_in_embree(robust):
    theirs, ours = same_scenes(lambda scene, module: stacked([0], module.TriangleMesh, scene), robust)
    found = ours.run(above(0), DOWN)
    assert found.tolist() == theirs.run(above(0), DOWN).tolist() == [0 if robust else -1]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_triangles_without_a_place_are_never_hit(value):
    corners = np.array([[[0, 0, 5], [1, 0, 5], [0, 1, value]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    theirs, ours = same_scenes(lambda scene, module: module.TriangleMesh(scene, corners))
    assert ours.run(above(9, 1), DOWN).tolist() == theirs.run(above(9, 1), DOWN).tolist() == [1, 1]


def test_dists_are_not_written_to():
    scene = stacked([0])
    for dists in (np.full(2, 9, np.float32), np.full(2, 9.0), np.array(9, np.float32)):
        given = dists.copy()
        dists.flags.writeable = False
        for query in QUERIES:
            found = scene.run(above(1, -1), DOWN, dists=dists, query=query)
            assert not np.shares_memory(found, dists)
        found = scene.run(above(1, -1), DOWN, dists=dists, output=1)["tfar"]
        assert found.tolist() == [1, 9]
        assert not np.shares_memory(found, dists)
        np.testing.assert_array_equal(dists, given)


@pytest.mark.parametrize("query", QUERIES)
def test_dists_end_rays(query):
    scene = stacked([0])
    ends = [np.nextafter(np.float32(1), np.float32(0)), 1, 2, np.inf, -1, np.nan]
    found = scene.run(above(*[1] * 6), DOWN, dists=ends, query=query)
    expected = {
        "INTERSECT": [-1, 0, 0, 0, -1, -1],
        "OCCLUDED": [-1, 0, 0, 0, -1, -1],
        "DISTANCE": [ends[0], 1, 1, 1, -1, np.nan],
    }
    np.testing.assert_array_equal(found, expected[query])
    np.testing.assert_array_equal(scene.run(above(-1), DOWN, query="DISTANCE"), np.float32([1e37]))


def test_meshes_added_after_a_query_are_hit():
    scene = stacked([0])
    assert (scene.is_committed, scene.run(above(3, -1), DOWN).tolist()) == (0, [0, -1])
    assert scene.is_committed == 1
    tree = scene.scene
    assert scene.run(above(3), DOWN).tolist() == [0]
    assert scene.scene is tree  # built once
    assert scene.run(above(3, -1), DOWN, output=True)["Ng"].tolist() == [[0, 0, 1], [0, 0, 0]]
    stacked([-2, 2], scene=scene)
    assert scene.is_committed == 0
    TriangleMesh(scene, np.zeros((0, 3), np.float32), np.zeros((0, 3), int))
    TriangleMesh(scene, np.array([[0, 0, 1], [2, 0, 1], [0, 1, 1]]), np.array([[0, 1, 2]] * 2))
    found = scene.run(above(3, 1.5, 0.5, -1, -3), DOWN, output=True)
    assert found["geomID"].tolist() == [2, 4, 0, 1, -1]
    assert found["primID"].tolist() == [0, 0, 0, 0, -1]
    assert found["Ng"][:, 2].tolist() == [1, 2, 1, 1, 0]
    assert len(scene.scene) == 5


def test_arrays_that_change_afterwards_change_no_scene():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    points, indices = corners[0].copy(), np.array([[0, 1, 2]], np.int32)
    for arrays in ((corners,), (points, indices)):
        scene = EmbreeScene()
        TriangleMesh(scene, *arrays)
        for array in arrays:
            array[:] = 0
        assert scene.run(above(1), DOWN).tolist() == [0]


def test_a_scene_without_meshes_is_never_hit():
    scene = EmbreeScene(EmbreeDevice())
    assert "wive" in repr(EmbreeDevice())
    assert scene.run(above(1), DOWN).tolist() == [-1]
    assert scene.run(above(1), DOWN, output=True)["geomID"].tolist() == [-1]
    none = np.zeros((0, 3), np.float32)
    assert [len(array) for array in stacked([0]).run(none, none, output=True).values()] == [0] * 6
    assert stacked([0]).run(none, DOWN, query="DISTANCE").dtype == np.float32


def test_any_memory_order_and_kind_of_array_is_read():
    vertices, faces = sphere(2)
    scene = EmbreeScene()
    TriangleMesh(scene, np.asfortranarray(vertices), np.asfortranarray(faces))
    origins, directions = random_rays(50, seed=5, low=-2, high=2)
    expected = wive.Scene(vertices, faces).intersect(origins, directions).prim
    assert (expected >= 0).any()
    for kind in (np.asfortranarray, np.ndarray.tolist, lambda rows: np.repeat(rows, 2, axis=0)[::2]):
        np.testing.assert_array_equal(scene.run(kind(origins), kind(directions)), expected)
    np.testing.assert_array_equal(scene.run(origins.astype(float), directions.astype(">f8")), expected)


@pytest.mark.parametrize(
    ("rays", "error", "message"),
    [
        ({"dists": np.ones(3, np.float32)}, ValueError, r"dists must be one number or have shape \(4,\)"),
        ({"dists": np.ones(5, np.float32)}, ValueError, r"dists .* got shape \(5,\)"),
        ({"dists": np.ones((4, 1), np.float32)}, ValueError, r"dists .* got shape \(4, 1\)"),
        ({"dists": "far"}, TypeError, "dists must be a real number"),
        ({"vec_directions": np.ones((3, 3))}, ValueError, r"vec_directions must have .* got \(3, 3\)"),
        ({"vec_directions": np.ones((0, 3))}, ValueError, r"vec_directions must have shape \(4, 3\)"),
        ({"vec_directions": np.ones((4, 2))}, ValueError, r"vec_directions must have shape \(n, 3\)"),
        ({"vec_directions": np.ones(3)}, ValueError, r"vec_directions must have shape \(n, 3\)"),
        ({"vec_origins": np.ones((4, 4))}, ValueError, r"vec_origins must have shape \(n, 3\), got \(4, 4\)"),
        ({"vec_origins": np.ones((1, 3))}, ValueError, r"vec_directions must have shape \(1, 3\)"),
        ({"vec_origins": None}, TypeError, "vec_origins must be"),
        ({"query": "intersect"}, ValueError, "query must be one of INTERSECT, OCCLUDED, DISTANCE"),
        ({"query": "OCCLUDED", "output": 1}, ValueError, "output is for queries INTERSECT and DISTANCE"),
    ],
)  # fmt: skip
def test_rays_that_do_not_fit_are_refused(rays, error, message):
    given = {"vec_origins": above(1, 1, 1, 1), "vec_directions": np.repeat(DOWN, 4, axis=0)} | rays
    with pytest.raises(error, match=message) as raised:
        stacked([0]).run(**given)
    assert "\n" not in str(raised.value)


POINTS = np.zeros((4, 3), np.float32)


@pytest.mark.parametrize(
    ("kind", "arrays", "error", "message"),
    [
        (TriangleMesh, (POINTS,), ValueError, r"shape \(f, 3, 3\), .* got \(4, 3\)"),
        (TriangleMesh, ([[[0, 0, 0]], [[0, 0]]],), ValueError, "got rows of unequal length"),
        (TriangleMesh, (POINTS, [[0, 1, 4]]), ValueError, r"indices .* 4 vertices .* \[0, 1, 4\] in row 0"),
        (TriangleMesh, (POINTS, [[0, 1, 2], [0, -1, 2]]), ValueError, r"got \[0, -1, 2\] in row 1"),
        (TriangleMesh, (POINTS, np.array([[0, 1, 2**32]])), ValueError, "indices must index the 4 vertices"),
        (TriangleMesh, (POINTS, [[0, 1, 2, 3]]), ValueError, r"must have shape \(f, 3\), got \(1, 4\)"),
        (TriangleMesh, (POINTS, [[0, 1, 2.0]]), TypeError, "indices must be .* integers, got dtype float64"),
        (TriangleMesh, (POINTS[:, :2], [[0, 1, 2]]), ValueError, r"vertices must have shape \(n, 3\)"),
        (TriangleMesh, ("mesh.ply", [[0, 1, 2]]), TypeError, "vertices must be"),
        (ElementMesh, (POINTS, [[0, 1, 2]]), ValueError, r"shape \(f, 4\) or \(f, 8\), got \(1, 3\)"),
        (ElementMesh, (POINTS, [[0, 1, 2, 9]]), ValueError, "indices must index the 4 vertices from 0"),
    ],
)  # fmt: skip
def test_meshes_that_are_none_are_refused_and_nothing_is_added(kind, arrays, error, message):
    scene = stacked([0])
    with pytest.raises(error, match=message) as raised:
        kind(scene, *arrays)
    assert "\n" not in str(raised.value)
    assert len(scene.scene) == 1


def test_scenes_and_devices_of_other_kinds_are_refused():
    with pytest.raises(TypeError, match=r"scene must be an EmbreeScene of wive\.embreex, got Scene"):
        TriangleMesh(wive.Scene(POINTS, [[0, 1, 2]]), POINTS, [[0, 1, 2]])
    with pytest.raises(TypeError, match="device must be an EmbreeDevice or None, got str"):
        EmbreeScene("cpu")


def test_names_are_where_embreex_has_them():
    from wive.embreex import rtcore, rtcore_scene
    from wive.embreex.mesh_construction import ElementMesh as Elements
    from wive.embreex.mesh_construction import TriangleMesh as Triangles

    assert (rtcore_scene.EmbreeScene, rtcore.EmbreeDevice) == (EmbreeScene, EmbreeDevice)
    assert (Triangles, Elements) == (wive.embreex.TriangleMesh, wive.embreex.ElementMesh)
