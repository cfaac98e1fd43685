"""`Scene.contains` and `Scene.signed_distance`: closed meshes by crossings, others by winding numbers."""

import numpy as np
import pytest
from support.closed_meshes import grid
from support.foreign_arrays import Foreign
from support.meshes import sphere

import wive

SIGNS = ("crossings", "winding")


def torus(rings: int = 48, sides: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """A closed ring, of radius 1 and thickness 0.4."""
    turns = np.arange(rings) * 2 * np.pi / rings, np.arange(sides) * 2 * np.pi / sides
    a, b = np.meshgrid(*turns, indexing="ij")
    out = 1 + 0.4 * np.cos(b)
    points = np.stack([out * np.cos(a), out * np.sin(a), 0.4 * np.sin(b)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    right, up = (i + 1) % rings, (j + 1) % sides
    corner = [k.ravel() * sides + m.ravel() for k, m in ((i, j), (right, j), (right, up), (i, up))]
    faces = np.concatenate([np.stack(corner, 1)[:, rows] for rows in ([0, 1, 2], [0, 2, 3])])
    return points.astype(np.float32), faces.astype(np.int32)


def around(count: int = 3000, seed: int = 1, size: float = 1.6) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-size, size, (count, 3)).astype(np.float32)


def in_torus(points: np.ndarray) -> np.ndarray:
    """The distance to the round torus, negative inside."""
    return np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1, points[:, 2]) - 0.4


@pytest.mark.parametrize("sign", SIGNS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_a_torus_contains_is_what_its_formula_says(cpu_backend, dtype, sign):
    vertices, faces = torus()
    points = around().astype(dtype)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend)
    expected, clear = in_torus(points), abs(in_torus(points)) > 0.02
    inside = scene.contains(points, sign=sign)
    assert inside.dtype == np.bool_ and inside.any()
    np.testing.assert_array_equal(inside[clear], expected[clear] < 0)
    signed = scene.signed_distance(points, sign=sign)
    assert signed.dtype == dtype
    np.testing.assert_array_equal(signed < 0, inside)
    np.testing.assert_array_equal(abs(signed), scene.closest(points).distance)
    np.testing.assert_allclose(signed, expected, atol=0.02)


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("accuracy", ["fast", "watertight", "exact"])
def test_every_accuracy_and_node_form_gives_the_same_answer(cpu_backend, accuracy, nodes):
    options = {"accuracy": accuracy, "nodes": nodes, "backend": cpu_backend}
    scene, usual = wive.Scene(*torus(), **options), wive.Scene(*torus(), backend="scalar")
    points = around(500)
    for sign in SIGNS:
        np.testing.assert_array_equal(scene.contains(points, sign=sign), usual.contains(points, sign=sign))


def test_rays_through_edges_and_vertices_of_a_grid_decide_rightly(cpu_backend):
    vertices, faces = grid(4)
    scene = wive.Scene(vertices, faces, backend=cpu_backend)
    places = np.stack(np.meshgrid(*[np.arange(-0.5, 5, 0.5)] * 3), axis=-1).astype(np.float32)
    clear = (
        ((places != 0) & (places != 4)).all(axis=-1) | (places < 0).any(axis=-1) | (places > 4).any(axis=-1)
    )
    inside = scene.contains(places)
    assert inside.shape == places.shape[:-1]
    np.testing.assert_array_equal(inside[clear], ((places > 0) & (places < 4)).all(axis=-1)[clear])


def test_answers_depend_neither_on_threads_nor_on_how_many_points_there_are(cpu_backend):
    holed = np.delete(sphere(3)[1], [5, 70, 400], axis=0)
    for faces in (sphere(3)[1], holed):
        scene = wive.Scene(sphere(3)[0], faces, backend=cpu_backend)
        points = around(2000, size=1.1)
        for sign in SIGNS:
            every = scene.signed_distance(points, sign=sign)
            np.testing.assert_array_equal(every, scene.signed_distance(points, sign=sign, threads=1))
            parts = [scene.signed_distance(part, sign=sign) for part in np.split(points, 40)]
            np.testing.assert_array_equal(every, np.concatenate(parts))


def test_winding_closes_holes_and_joins_what_overlaps(cpu_backend):
    vertices, faces = sphere(3)
    points = around(2000, size=1.5)
    radius = np.linalg.norm(points, axis=1)
    holed = faces[np.random.default_rng(3).random(len(faces)) < 0.9]
    scene = wive.Scene(vertices, holed, backend=cpu_backend)
    clear = abs(radius - 0.995) > 0.12
    np.testing.assert_array_equal(scene.contains(points, sign="winding")[clear], radius[clear] < 1)
    # two balls that overlap: crossings leave out what is in both, winding numbers don't
    aside = np.array([0.5, 0, 0], np.float32)
    pair = np.concatenate([vertices - aside, vertices + aside])
    both = wive.Scene(pair, np.concatenate([faces, faces + len(vertices)]), backend=cpu_backend)
    one, other = (np.linalg.norm(points + side, axis=1) for side in (aside, -aside))
    clear = (abs(one - 0.995) > 0.02) & (abs(other - 0.995) > 0.02)
    np.testing.assert_array_equal(
        both.contains(points, sign="winding")[clear], ((one < 1) | (other < 1))[clear]
    )
    np.testing.assert_array_equal(both.contains(points)[clear], ((one < 1) ^ (other < 1))[clear])
    # and faces stored twice, or turned inside out
    for many in (np.concatenate([faces, faces]), faces[:, ::-1]):
        scene = wive.Scene(vertices, np.ascontiguousarray(many), backend=cpu_backend)
        clear = abs(radius - 0.995) > 0.02
        np.testing.assert_array_equal(scene.contains(points, sign="winding")[clear], radius[clear] < 1)


def test_of_a_mesh_with_a_hole_rays_have_to_agree(cpu_backend):
    vertices, faces = sphere(3)
    points = around(3000, size=0.9)
    scene = wive.Scene(vertices, faces[1:], backend=cpu_backend)
    radius = np.linalg.norm(points, axis=1)
    assert scene.contains(points)[radius < 0.8].mean() > 0.995  # all but those that see out through it


@pytest.mark.parametrize("sign", SIGNS)
def test_points_that_are_no_numbers_are_outside_and_infinitely_far(backend, sign):
    scene = wive.Scene(*sphere(2), backend=backend)
    points = np.array([[0, 0, 0], [np.nan, 0, 0], [0, np.inf, 0], [0, 0, 5]], np.float32)
    assert scene.contains(points, sign=sign).tolist() == [True, False, False, False]
    signed = scene.signed_distance(points, sign=sign)
    assert signed[0] < 0 and signed[1] == signed[2] == np.inf and signed[3] > 3.9


def test_an_empty_scene_contains_nothing(backend):
    scene = wive.Scene(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), backend=backend)
    for sign in SIGNS:
        assert not scene.contains(np.zeros((3, 3)), sign=sign).any()
        assert np.isinf(scene.signed_distance(np.zeros((3, 3)), sign=sign)).all()
        assert scene.contains(np.zeros((0, 3)), sign=sign).shape == (0,)


def test_shapes_and_libraries_are_those_of_the_points(backend):
    scene, points = wive.Scene(*sphere(2), backend=backend), around(24)
    for sign in SIGNS:
        inside, signed = scene.contains(points, sign=sign), scene.signed_distance(points, sign=sign)
        shaped = points.reshape(2, 3, 4, 3)
        np.testing.assert_array_equal(scene.contains(shaped, sign=sign), inside.reshape(2, 3, 4))
        np.testing.assert_array_equal(scene.signed_distance(shaped, sign=sign), signed.reshape(2, 3, 4))
        if backend != "warp":
            assert isinstance(scene.contains(Foreign.Array(points), sign=sign), Foreign.Array)
        assert scene.contains([0, 0, 0], sign=sign).tolist() == [True]


def test_arrays_of_warp_stay_on_its_device(device):
    wp = pytest.importorskip("warp")
    points = around(500)
    for dtype, vec3 in ((np.float32, wp.vec3), (np.float64, wp.vec3d)):
        scene = wive.Scene(sphere(2)[0].astype(dtype), sphere(2)[1], device=device)
        there = wp.array(points.astype(dtype), dtype=vec3, device=device)
        np.testing.assert_array_equal(scene.contains(there).numpy(), scene.contains(points.astype(dtype)))
        signed = scene.signed_distance(there)
        assert str(signed.device) == device
        np.testing.assert_array_equal(signed.numpy(), scene.signed_distance(points.astype(dtype)))


def test_after_a_refit_the_new_positions_decide(backend):
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces, backend=backend)
    for sign in SIGNS:
        scene.refit(vertices)
        assert not scene.contains([[0, 0, 2]], sign=sign)[0]
        scene.refit(vertices * np.float32(3))
        assert scene.contains([[0, 0, 2]], sign=sign)[0]


def test_another_sign_is_refused(backend):
    scene = wive.Scene(*sphere(1), backend=backend)
    for query in (scene.contains, scene.signed_distance):
        with pytest.raises(ValueError, match=r"^sign must be one of crossings, winding"):
            query(np.zeros((1, 3)), sign="rays")
        with pytest.raises(ValueError, match=r"^points must have shape \(\.\.\., 3\)"):
            query(np.zeros((1, 2)))
