"""A refitted scene gives the hits of a new scene."""

import pickle
import threading
from pathlib import Path

import numpy as np
import pytest
from support.float32_trees import leaf_blocks, planes, used_lanes, walk
from support.meshes import assert_same_hits, random_rays, soup, sphere

import wive
from wive import _cpu

Mesh = tuple[np.ndarray, np.ndarray]

FAR = np.float32([148376, 1234, -223423])


def bent(vertices: np.ndarray, by: float = 0.3) -> np.ndarray:
    """A smooth bend, so that every vertex moves."""
    x, y, z = vertices.astype(np.float64).T
    return np.stack([x + by * np.sin(3 * y), y + by * np.cos(2 * z), z * (1 + by * x)], axis=1).astype(
        np.float32
    )


def shuffled(vertices: np.ndarray) -> np.ndarray:
    """The vertices in another order, for which the old tree is as bad as possible."""
    return np.random.default_rng(1).permutation(vertices)


MOVES = {
    "bent": bent,
    "shuffled": shuffled,
    "moved far away": lambda vertices: vertices + FAR,
    "made tiny": lambda vertices: vertices * np.float32(1e-6),
    "left alone": lambda vertices: vertices.copy(),
    "flattened": lambda vertices: vertices * np.float32([1, 1, 0]),
}


@pytest.fixture(params=MOVES)
def moved(request: pytest.FixtureRequest) -> np.ndarray:
    vertices: np.ndarray = MOVES[request.param](sphere(4)[0])
    return vertices


def rays_for(vertices: np.ndarray, count: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    """Rays from around the mesh towards points of it."""
    origins, _ = random_rays(count, seed=2)
    lowest, highest = vertices.min(axis=0), vertices.max(axis=0)
    middle, size = (lowest + highest) / 2, (highest - lowest).max()
    origins = (middle + size * origins).astype(np.float32)
    targets = vertices[np.random.default_rng(3).integers(len(vertices), size=count)]
    return origins, (targets - origins).astype(np.float32)


def assert_same_answers(one: wive.Scene, other: wive.Scene, rays: tuple[np.ndarray, np.ndarray]) -> None:
    assert_same_hits(one.intersect(*rays), other.intersect(*rays))
    np.testing.assert_array_equal(one.occluded(*rays), other.occluded(*rays))
    np.testing.assert_array_equal(one.bounds, other.bounds)
    np.testing.assert_array_equal(one.intersect(*rays).points(), other.intersect(*rays).points())


def test_hits_after_a_refit_are_those_of_a_new_scene_bit_for_bit(backend: str, moved: np.ndarray) -> None:
    vertices, faces = sphere(4)
    scene = wive.Scene(vertices, faces, backend=backend)
    scene.refit(moved)
    rays = rays_for(moved)
    assert scene.intersect(*rays).mask.any() or moved[:, 2].max() == 0
    assert_same_answers(scene, wive.Scene(moved, faces, backend=backend), rays)


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
@pytest.mark.parametrize("quality", ["medium", "high"])
def test_options_are_kept(accuracy: str, quality: str) -> None:
    vertices, faces = soup(2000, seed=4)
    scene = wive.Scene(vertices, faces, accuracy=accuracy, quality=quality)
    scene.refit(bent(vertices))
    assert scene.accuracy == accuracy
    assert_same_answers(
        scene, wive.Scene(bent(vertices), faces, accuracy=accuracy), random_rays(3000, seed=5)
    )


def test_a_refitted_tree_keeps_its_shape_and_holds_its_triangles_tightly(moved: np.ndarray) -> None:
    vertices, faces = sphere(4)
    before = _cpu.Bvh(vertices, faces)
    bvh = before.refitted(moved)
    np.testing.assert_array_equal(bvh.nodes[:, 6:], before.nodes[:, 6:])
    low, high = planes(bvh)
    used = used_lanes(bvh)
    for node, lane, _, child in walk(bvh):
        if child >= 1 << 31:
            prims = bvh.blocks[list(leaf_blocks(bvh, child)), 9].view(np.int32).ravel()
            inside = moved[faces[prims[prims >= 0]]].astype(np.float64).reshape(-1, 3)
            lowest, highest = inside.min(axis=0), inside.max(axis=0)
        else:
            lanes = used[child // 64]
            lowest, highest = low[child // 64][lanes].min(axis=0), high[child // 64][lanes].max(axis=0)
        largest = np.abs([lowest - bvh.center, highest - bvh.center]).max()
        # The slack of a leaf's box; a node's box shares that of its children.
        least = 16 * 2.0**-24 * largest if child >= 1 << 31 else 0.0
        most = 18 * 2.0**-24 * largest + np.spacing(np.abs(moved).max() + 1e-30) * 2
        for looser in (lowest - low[node, lane], high[node, lane] - highest):
            assert (looser >= least).all()
            assert (looser <= most).all()


def test_a_refit_back_restores_the_tree_bit_for_bit() -> None:
    vertices, faces = soup(20_000, seed=6)
    bvh = _cpu.Bvh(vertices, faces)
    there = bvh.refitted(bent(vertices) + FAR)
    assert not np.array_equal(there.units, bvh.units)
    assert np.array_equal(there.refitted(vertices).units, bvh.units)


def test_a_refit_does_not_depend_on_threads() -> None:
    vertices, faces = soup(50_000, seed=7, size=0.02)
    bvh = _cpu.Bvh(vertices, faces)
    one, many = (bvh.refitted(bent(vertices), threads=threads) for threads in (1, 5))
    assert np.array_equal(one.units, many.units)


def test_triangles_that_lose_their_area_are_not_hit_and_come_back_with_it(backend: str) -> None:
    vertices, faces = soup(300, seed=8)
    scene = wive.Scene(vertices, faces, backend=backend)
    rays = random_rays(3000, seed=9, low=0, high=1)
    collapsed = vertices.copy()
    collapsed[:450:3] = collapsed[1:450:3]  # the first 150 triangles become lines
    scene.refit(collapsed)
    assert scene.intersect(*rays).prim[scene.intersect(*rays).mask].min() >= 150
    assert_same_answers(scene, wive.Scene(collapsed, faces, backend=backend), rays)
    scene.refit(vertices)
    assert_same_answers(scene, wive.Scene(vertices, faces, backend=backend), rays)
    assert (scene.intersect(*rays).prim < 150)[scene.intersect(*rays).mask].any()


def test_a_mesh_may_lose_all_its_area_and_get_it_back() -> None:
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces)
    scene.refit(np.zeros_like(vertices))
    rays = random_rays(500, seed=10)
    assert not scene.intersect(*rays).mask.any()
    assert np.isinf(scene.bounds).all()
    scene.refit(vertices)
    assert_same_answers(scene, wive.Scene(vertices, faces), rays)


def test_a_triangle_without_area_at_first_is_hit_once_it_has_one() -> None:
    vertices = np.float32([[0, 0, 1], [1, 0, 1], [2, 0, 1], [0, 0, 2], [1, 0, 2], [0, 1, 2]])
    faces = np.int32([[0, 1, 2], [3, 4, 5]])
    scene = wive.Scene(vertices, faces)
    assert scene.intersect([0.1, 0.1, 0], [0, 0, 1]).prim[0] == 1
    vertices = vertices.copy()
    vertices[2] = [0, 1, 1]
    scene.refit(vertices)
    assert scene.intersect([0.1, 0.1, 0], [0, 0, 1]).prim[0] == 0


def test_saving_and_pickling_keep_the_new_positions(tmp_path: Path) -> None:
    vertices, faces = soup(500, seed=11)
    scene = wive.Scene(vertices, faces)
    scene.refit(bent(vertices))
    np.testing.assert_array_equal(scene.vertices, bent(vertices))
    scene.save(tmp_path / "scene.npz")
    rays = random_rays(1000, seed=12)
    for copy in (wive.load(tmp_path / "scene.npz"), pickle.loads(pickle.dumps(scene))):
        assert_same_answers(copy, scene, rays)


def test_queries_see_the_old_positions_or_the_new_ones_while_another_thread_refits() -> None:
    vertices, faces = sphere(4)
    places = [vertices, vertices * np.float32(1.5)]
    scene = wive.Scene(vertices, faces)
    rays = random_rays(500, seed=13)
    expected = [wive.Scene(place, faces).intersect(*rays) for place in places]
    stop = threading.Event()

    def refit() -> None:
        turn = 0
        while not stop.is_set():
            turn += 1
            scene.refit(places[turn % 2])

    thread = threading.Thread(target=refit)
    thread.start()
    try:
        for _ in range(100):
            hits = scene.intersect(*rays, threads=1)
            answer = [hits.t, hits.points()]
            assert any(
                all(
                    np.array_equal(a, b, equal_nan=True)
                    for a, b in zip(answer, (one.t, one.points()), strict=True)
                )
                for one in expected
            )
    finally:
        stop.set()
        thread.join()


@pytest.mark.parametrize(
    ("vertices", "error", "message"),
    [
        (
            np.zeros((41, 3)),
            ValueError,
            r"vertices must have shape \(42, 3\), as the scene's own, got \(41, 3\)",
        ),
        (np.zeros((42, 2)), ValueError, r"vertices must have shape \(v, 3\), got \(42, 2\)"),
        (np.full((42, 3), "x"), TypeError, "vertices must be a .* array of real numbers"),
        (np.where(np.arange(126) == 100, np.nan, 0).reshape(42, 3), ValueError, r"vertices\[33\] = "),
        (np.where(np.arange(126) == 7, np.inf, 0).reshape(42, 3), ValueError, r"vertices\[2\] = "),
    ],
)
def test_bad_positions_are_refused_and_the_scene_stays(
    vertices: np.ndarray, error: type[Exception], message: str
) -> None:
    mesh = sphere(1)
    scene = wive.Scene(*mesh)
    with pytest.raises(error, match=message):
        scene.refit(vertices)
    assert_same_answers(scene, wive.Scene(*mesh), random_rays(200, seed=14))


def test_float64_and_lists_are_converted() -> None:
    vertices, faces = sphere(1)
    scene = wive.Scene(vertices, faces)
    scene.refit((2 * vertices).astype(np.float64).tolist())
    np.testing.assert_array_equal(scene.bounds, 2 * wive.Scene(vertices, faces).bounds)
