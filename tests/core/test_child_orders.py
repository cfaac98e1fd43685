"""Orders of visiting a node's children, and kernels that sort them by distance: all give the same hits."""

from typing import Any

import numpy as np
import pytest
from support.meshes import soup, sphere
from support.order_study import order_study, study

from wive import _cpu

__all__ = ["order_study"]  # a fixture

STORED = ("treelet", "diagonal", "slots", "none")
SORTING = [
    pytest.param(name, marks=pytest.mark.skipif(bool(reason), reason=reason))
    for name, reason in ((name, _cpu.kernels()[alike]) for name, alike in study.SORTING.items())
]


def rays(count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    origins, directions = rng.normal(size=(2, count, 3)).astype(np.float32)
    return origins, directions, np.full(1, -0.5, np.float32), np.full(1, np.inf, np.float32)


def eight_clusters() -> tuple[np.ndarray, np.ndarray]:
    """Five triangles round each corner of a cube, so that the root's eight children are the clusters."""
    rng = np.random.default_rng(3)
    corners = np.array(list(np.ndindex(2, 2, 2)), np.float32) * 10
    vertices = np.repeat(corners, 15, axis=0) + rng.uniform(-0.5, 0.5, (120, 3))
    return vertices.astype(np.float32), np.arange(120, dtype=np.int32).reshape(-1, 3)


def test_children_in_the_corners_get_the_slots_of_those_corners(order_study: Any) -> None:
    root = order_study.tree(*eight_clusters(), "watertight", "slots").nodes[0]
    centres = root[:6].view(np.float32).reshape(3, 2, 8).sum(axis=1)
    places = (centres > centres.mean(axis=1, keepdims=True)).T @ [1, 2, 4]
    assert sorted(places) == list(range(8))
    for octant in range(8):
        visited = places[root[7] >> np.uint32(4 * octant) & np.uint32(7)]
        assert list(visited) == [i ^ octant for i in range(8)]


@pytest.mark.parametrize("order", STORED)
def test_every_order_is_a_permutation_for_every_octant(order_study: Any, order: str) -> None:
    nodes = order_study.tree(*soup(3000, seed=2), "watertight", order).nodes
    for octant in range(8):
        slots = np.sort(nodes[:, 7] >> np.uint32(4 * octant) & np.uint32(7), axis=1)
        assert (slots == np.arange(8)).all()


def test_without_order_every_octant_has_one_and_the_same_shuffled_sequence(order_study: Any) -> None:
    mesh = sphere(4)
    ordered, shuffled = (order_study.tree(*mesh, "watertight", order) for order in ("treelet", "none"))
    assert np.array_equal(ordered.nodes[:, :7], shuffled.nodes[:, :7])
    sequences = [shuffled.nodes[:, 7] >> np.uint32(4 * octant) & np.uint32(7) for octant in range(8)]
    assert all(np.array_equal(sequence, sequences[0]) for sequence in sequences)
    assert (np.sort(sequences[0], axis=1) == np.arange(8)).all()
    assert (sequences[0] != np.arange(8)).any()


@pytest.mark.parametrize("order", ["treelet", "diagonal", "slots"])
def test_opposite_octants_visit_the_same_children_backwards(order_study: Any, order: str) -> None:
    nodes = order_study.tree(*soup(3000, seed=2), "watertight", order).nodes
    counts = (nodes[:, 0].view(np.float32) < 1e24).sum(axis=1)
    for octant in range(4):
        slots, opposite = (nodes[:, 7] >> np.uint32(4 * o) & np.uint32(7) for o in (octant, 7 - octant))
        for one, other, count in zip(slots, opposite, counts, strict=True):
            assert list(one[:count]) == list(other[:count][::-1])


@pytest.mark.parametrize("order", STORED)
def test_hits_do_not_depend_on_the_order(order_study: Any, order: str) -> None:
    batch = rays(5000, seed=5)
    reference = _cpu.Bvh(*soup(3000, seed=2)).intersect("scalar", *batch)
    hits = order_study.tree(*soup(3000, seed=2), "watertight", order).intersect("scalar", *batch)
    for ours, theirs in zip(hits[:3], reference[:3], strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("in_flight", [1, 24])
@pytest.mark.parametrize("kernel", SORTING)
def test_sorting_by_distance_gives_the_same_hits_in_fewer_steps_than_no_order(
    order_study: Any, kernel: str, in_flight: int
) -> None:
    batch = rays(5000, seed=6)
    unordered = order_study.tree(*soup(3000, seed=2), "watertight", "none")
    plain = unordered.intersect("scalar", *batch, stats=True)
    by_distance = order_study.intersect(kernel, unordered, *batch, in_flight=in_flight, stats=True)
    for ours, theirs in zip(by_distance[:3], plain[:3], strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert plain[3] is not None
    assert by_distance[3] is not None
    assert (by_distance[3].sum(axis=0) < 0.95 * plain[3].sum(axis=0)).all()
