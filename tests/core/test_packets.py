"""Coherent rays, of a picture, a scan or a fan, find in packets the hits that each finds alone."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from support.batches import Batch
from support.closed_meshes import leaving, placed
from support.doubles import survey
from support.hard_sets import SETS, hard_set
from support.meshes import soup, sphere

from wive import _cpu

KERNELS = [name for name, reason in _cpu.kernels().items() if not reason]
TOGETHER = 16  # rays per packet (packet.h), and the fewest rays in flight for which packets are formed


def batch(mesh: tuple[np.ndarray, np.ndarray], origins: np.ndarray, directions: np.ndarray) -> Batch:
    """Rays without limits, in the numbers of the mesh."""
    number = mesh[0].dtype
    rays = (np.ascontiguousarray(array, number) for array in (origins, directions))
    return Batch(*mesh, *rays, np.zeros(1, number), np.full(1, np.inf, number))


def picture(mesh: tuple[np.ndarray, np.ndarray], unit: bool) -> Batch:
    """A camera's rays row by row: within rows, signs of directions change, and so does the longest axis."""
    low, high = mesh[0].min(axis=0).astype(np.float64), mesh[0].max(axis=0).astype(np.float64)
    y, x = np.meshgrid(np.linspace(-1.3, 1.3, 9), np.linspace(-1.3, 1.3, 500), indexing="ij")
    directions = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    if unit:
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    eye = (low + high) / 2 - np.array([0.02, 0.01, 0.8]) * (high - low).max()
    return batch(mesh, np.broadcast_to(eye, directions.shape), directions)


def telescope(mesh: tuple[np.ndarray, np.ndarray]) -> Batch:
    """A camera's rays from far away, row by row, so far apart that neighbours share only the upper nodes."""
    low, high = mesh[0].min(axis=0).astype(np.float64), mesh[0].max(axis=0).astype(np.float64)
    middle, size = (low + high) / 2, (high - low).max()
    y, x = np.meshgrid(np.linspace(-0.6, 0.6, 70), np.linspace(-0.6, 0.6, 70), indexing="ij")
    targets = middle + np.stack([x, np.zeros_like(x), y], axis=-1).reshape(-1, 3) * size
    eye = middle - np.array([3, 20, 40]) * size
    return batch(mesh, np.broadcast_to(eye, targets.shape), targets - eye)


def scan(mesh: tuple[np.ndarray, np.ndarray], direction: tuple[float, float, float]) -> Batch:
    """Parallel rays from a plane above the mesh, row by row; some of their limits are empty."""
    low, high = mesh[0].min(axis=0).astype(np.float64), mesh[0].max(axis=0).astype(np.float64)
    size = (high - low).max()
    grid = np.meshgrid(np.linspace(0, 1, 7), np.linspace(-0.1, 1.1, 800), indexing="ij")
    places = np.stack(grid, axis=-1).reshape(-1, 2)
    origins = np.append(low[:2] + places * size, np.full((len(places), 1), high[2] + 0.3 * size), axis=1)
    rays = batch(mesh, origins, np.broadcast_to(direction, origins.shape))
    random = np.random.default_rng(5)
    near, far = np.sort(random.uniform(0, 2 * size, (2, len(origins))), axis=0).astype(origins.dtype)
    near[::97], far[::97] = far[::97], near[::97]
    return rays._replace(tmin=near.astype(mesh[0].dtype), tmax=far.astype(mesh[0].dtype))


def with_bad_rays(rays: Batch) -> Batch:
    """The batch with some rays that miss by rule."""
    origins, directions = rays.origins.copy(), rays.directions.copy()
    origins[5::301, 1] = np.nan
    directions[111::407] = 0
    directions[207::509, 2] = np.inf
    return rays._replace(origins=origins, directions=directions)


def at_edges(scale: float, place: tuple[float, float, float]) -> Batch:
    """Rays from the middle of a closed sphere at its vertices and points of its edges, in coherent order."""
    mesh = placed(sphere(4), scale, place)
    origins, directions = leaving(mesh, 200_000, np.random.default_rng(7), spread=0.0)
    patch = np.flatnonzero((directions[:, 0] == abs(directions).max(axis=1)) & (directions > 0).all(axis=1))
    order = patch[np.lexsort(np.floor(12 * directions[patch] / directions[patch, :1]).T)]
    return batch(mesh, origins[order], directions[order])


def sixteen_of_each(name: str, count: int) -> Batch:
    """The rays of a hard set, each repeated to fill a packet."""
    vertices, faces, origins, directions = hard_set(name)
    chosen = np.repeat(np.linspace(0, len(origins) - 1, count).astype(int), TOGETHER)
    return batch((vertices, faces), origins[chosen], directions[chosen])


BATCHES: dict[str, Callable[[], Batch]] = {
    "picture": partial(picture, soup(1500, 1), unit=True),
    "picture, directions of any length": partial(picture, soup(1500, 2, size=0.05), unit=False),
    "picture far away": partial(picture, placed(sphere(4), 1000.0, (148376, 1234, -223423)), unit=True),
    "telescope": partial(telescope, sphere(6)),
    "telescope, long triangles": partial(telescope, soup(3000, 8)),
    "tiny picture": partial(picture, placed(soup(1500, 3), 1e-6, (0, 0, 0)), unit=True),
    "scan straight down": partial(scan, soup(1500, 4), (0.0, -0.0, -1.0)),
    "slanted scan": partial(scan, soup(1500, 4), (0.4, 0.3, -1.5)),
    "bad rays among others": lambda: with_bad_rays(picture(soup(1500, 6), unit=False)),
    "edges": partial(at_edges, 1.0, (0, 0, 0)),
    "edges far away": partial(at_edges, 1000.0, (-3e6, 2e6, 1e6)),
    **{f"{name}, each sixteen times": partial(sixteen_of_each, name, 40) for name in SETS},
}


def share_of_packets(rays: Batch, bvh: _cpu.Bvh) -> float:
    """The share of packets, from the first ray on, that cpu/traverse/packet.h accepts."""
    n = len(rays.origins) // TOGETHER * TOGETHER
    arrays = rays.origins, rays.directions
    origins, directions = (a[:n].astype(np.float64).reshape(-1, TOGETHER, 3) for a in arrays)
    longest = abs(directions).max(axis=2)
    scale, negative = np.frexp(longest)[1], np.signbit(directions)
    turn, shift = np.ptp(directions, axis=1).max(axis=1), np.ptp(origins, axis=1).max(axis=1)
    good = (scale == scale[:, :1]).all(axis=1) & (negative == negative[:, :1]).all(axis=(1, 2))
    return float((good & (turn <= longest.max(axis=1) / 8) & (shift <= bvh.extent.max() / 16)).mean())


def answers(bvh: _cpu.Bvh, kernel: str, rays: Batch, threads: int, in_flight: int) -> list[bytes]:
    """The results of every query, as bits; kernels for comparisons have closest hits alone."""
    arguments = kernel, *rays[2:], threads, in_flight
    found = list(bvh.intersect(*arguments)[:3])
    if not kernel.endswith("distance"):
        many = bvh.intersect_all(*arguments)
        found += [bvh.occluded(*arguments)[0], bvh.count(*arguments)[0], *many[:4]]
    return [np.ascontiguousarray(array).tobytes() for array in found]


@pytest.mark.parametrize("name", BATCHES)
@pytest.mark.parametrize("kernel", KERNELS)
def test_hits_are_those_of_each_ray_alone(kernel: str, name: str) -> None:
    rays = BATCHES[name]()
    forms = [("float32", "watertight")]
    if not kernel.endswith("distance"):
        forms += [("float32", "fast"), ("float32", "exact")]
    if not kernel.endswith(("half", "distance")):
        forms += [("compressed", "watertight"), ("compressed", "fast")]
    for nodes, accuracy in forms:
        bvh = _cpu.Bvh(rays.vertices, rays.faces, accuracy, nodes=nodes)
        assert share_of_packets(rays, bvh) > 0.5
        alone = answers(bvh, kernel, rays, 1, 1)
        for threads, in_flight in ((1, TOGETHER), (2, 0)):
            assert answers(bvh, kernel, rays, threads, in_flight) == alone, (nodes, accuracy, in_flight)


@pytest.mark.parametrize("kernel", ["avx512", "avx2", "scalar"])
def test_hits_of_doubles_are_those_of_each_ray_alone(kernel: str) -> None:
    if kernel not in KERNELS:
        pytest.skip(_cpu.kernels().get(kernel, "not built"))
    mesh = survey(4)
    batches = [picture(mesh, unit=True), with_bad_rays(scan(mesh, (0.1, 0.2, -1.0)))]
    for rays in batches:
        for nodes in ("float32", "compressed"):
            for accuracy in ("fast", "watertight"):
                bvh = _cpu.Bvh(rays.vertices, rays.faces, accuracy, nodes=nodes)
                alone = answers(bvh, kernel, rays, 1, 1)
                assert answers(bvh, kernel, rays, 1, TOGETHER) == alone, (nodes, accuracy)
        assert np.frombuffer(alone[1], np.int32).max() >= 0


@pytest.mark.parametrize("name", ["edges", "edges far away"])
@pytest.mark.parametrize("accuracy", ["watertight", "exact"])
@pytest.mark.parametrize("kernel", ["avx512", "avx2", "scalar"])
def test_nothing_leaks_at_edges_and_vertices(kernel: str, accuracy: str, name: str) -> None:
    if kernel not in KERNELS:
        pytest.skip(_cpu.kernels().get(kernel, "not built"))
    rays = BATCHES[name]()
    bvh = _cpu.Bvh(rays.vertices, rays.faces, accuracy)
    assert (bvh.intersect(kernel, *rays[2:])[1] >= 0).all()
    assert bvh.occluded(kernel, *rays[2:])[0].all()
