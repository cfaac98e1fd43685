"""float64 scenes on Warp: the bits of the C++ core in both lane forms, and what only double tells apart."""

import numpy as np
import pytest

pytest.importorskip("warp")

from support.hard_rays import HARD_MESHES, hard_rays
from support.meshes import random_rays, soup, sphere
from support.warp_launches import assert_bit_identical, cpu_answers, warp_answers

from wive import _cpu

pytestmark = pytest.mark.timeout(180)

ACCURACIES = ("fast", "watertight")
FORMS = ("float32", "compressed")
UTM = np.array([448262.1934, 5411933.4527, 312.0031])
Mesh = tuple[np.ndarray, np.ndarray]


def in_double(mesh: Mesh, move: np.ndarray | float = 0.0, seed: int | None = None) -> Mesh:
    """The mesh in float64, elsewhere, and with `seed` its vertices moved by what float32 does not hold."""
    vertices = mesh[0].astype(np.float64) + move
    if seed is not None:
        vertices += 1e-9 * np.random.default_rng(seed).standard_normal(vertices.shape)
    return vertices, mesh[1]


HARD = {
    **{name: in_double(mesh()) for name, mesh in HARD_MESHES.items()},
    "sphere at UTM coordinates": in_double(sphere(3), UTM, 1),
    "small sphere at UTM coordinates": in_double(sphere(2, 1e-3), UTM, 2),
    "grid at UTM coordinates": in_double(HARD_MESHES["integer grid"](), np.round(UTM)),
}

HARDEST = ("coincident", "sphere at UTM coordinates", "grid at UTM coordinates")


@pytest.mark.parametrize("nodes", FORMS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_hard_rays_give_the_bits_of_the_core_in_every_form(accuracy: str, nodes: str) -> None:
    for vertices, faces in (HARD[name] for name in (HARD if nodes == "float32" else HARDEST)):
        bvh = _cpu.Bvh(vertices, faces, accuracy, nodes=nodes)
        given = hard_rays(vertices, faces) if len(faces) else [*map(np.float64, random_rays(50, 8))]
        tmin = np.full(1, -np.inf)  # also behind the origin: t of either sign
        for lanes, step in ((8, 1), (1, 5)):  # fibers are slow
            rays = *(np.ascontiguousarray(rows[::step]) for rows in given), tmin
            reference = cpu_answers(bvh, "scalar", *rays)
            assert reference.t.dtype == reference.uv.dtype == np.float64
            assert_bit_identical(warp_answers(bvh, lanes, *rays), reference)


@pytest.mark.parametrize("nodes", FORMS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_random_rays_give_the_bits_of_the_core_in_every_form(accuracy: str, nodes: str) -> None:
    vertices, faces = in_double(soup(3000, 2), 0.0, 3)
    bvh = _cpu.Bvh(vertices, faces, accuracy, nodes=nodes)
    origins, directions = map(np.float64, random_rays(1001, 3, 0.0, 1.0))
    random = np.random.default_rng(4)
    directions *= 2.0 ** random.integers(-900, 900, (len(directions), 1))  # t beyond what float32 holds
    tmin, tmax = np.zeros(1), np.full(1, np.inf)
    reference = cpu_answers(bvh, "scalar", origins, directions, tmin, tmax)
    assert (reference.prim >= 0).mean() > 0.5
    assert_bit_identical(warp_answers(bvh, 8, origins, directions, tmin, tmax), reference)
    few = slice(0, 101)  # fibers are slow
    reference = cpu_answers(bvh, "scalar", origins[few], directions[few], tmin, tmax)
    assert_bit_identical(warp_answers(bvh, 1, origins[few], directions[few], tmin, tmax), reference)


@pytest.mark.parametrize("lanes", [8, 1])
def test_closed_sphere_at_utm_coordinates_never_leaks_at_vertices_and_edges(lanes: int) -> None:
    vertices, faces = in_double(sphere(3), UTM, 5)
    aims = np.concatenate([vertices, vertices[faces][:, :2].mean(axis=1)])[:: 10 if lanes == 1 else 1]
    origins = np.tile(UTM, (len(aims), 1))
    found = warp_answers(_cpu.Bvh(vertices, faces, "watertight"), lanes, origins, aims - origins)
    assert (found.prim >= 0).all() and found.occluded.all()


def layers(heights: np.ndarray) -> Mesh:
    """One triangle at each height."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    vertices = corners + np.array([0.0, 0.0, 1.0]) * heights[:, None, None]
    return vertices.reshape(-1, 3), np.arange(3 * len(heights), dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_nearest_of_hits_whose_t_round_to_one_float32_is_found(accuracy: str, lanes: int) -> None:
    steps = np.random.default_rng(6).permutation(64)
    bvh = _cpu.Bvh(*layers(1.0 + 2.0**-30 + steps * 2.0**-52), accuracy)
    origins, directions = np.array([[0.25, 0.25, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    found = warp_answers(bvh, lanes, origins, directions)
    nearest = np.argsort(steps)
    assert found.prim == nearest[0] and found.t == 1.0 + 2.0**-30
    assert found.counts == 64
    np.testing.assert_array_equal(found.all_prim, nearest)
    np.testing.assert_array_equal(found.all_t, 1.0 + 2.0**-30 + np.arange(64) * 2.0**-52)


@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_limits_are_kept_to_in_double(accuracy: str, lanes: int) -> None:
    height = 1.0 / 3.0
    bvh = _cpu.Bvh(*layers(np.array([height])), accuracy)
    origins, directions = np.tile([0.25, 0.25, 0.0], (6, 1)), np.tile([0.0, 0.0, 1.0], (6, 1))
    t = warp_answers(bvh, lanes, origins[:1], directions[:1]).t[0]
    below, above = np.nextafter(t, 0.0), np.nextafter(t, 1.0)
    tmin = np.array([0.0, t, above, 0.0, 0.0, np.nan])
    tmax = np.array([t, t, 1.0, below, -0.5, 1.0])
    found = warp_answers(bvh, lanes, origins, directions, tmin, tmax)
    np.testing.assert_array_equal(found.prim, [0, 0, -1, -1, -1, -1])
    np.testing.assert_array_equal(found.occluded, found.prim == 0)
    np.testing.assert_array_equal(found.counts, found.prim == 0)
