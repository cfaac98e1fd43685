"""The built tree: complete, conservative, of bounded depth, and the same on any number of threads."""

import numpy as np
import pytest
from support.float32_trees import LEAF, leaf_blocks, planes, used_lanes, walk
from support.meshes import soup, sphere

from wive import _cpu

MESHES = {
    "one triangle": (np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)),
    "five triangles": soup(5, seed=1),
    "sphere": sphere(4),
    "soup": soup(3000, seed=2),
    "far away": (sphere(3)[0] + np.float32([148376, 1234, -223423]), sphere(3)[1]),
    "all alike": (
        np.tile(np.eye(3, dtype=np.float32), (1000, 1)),
        np.arange(3000, dtype=np.int32).reshape(-1, 3),
    ),
}


@pytest.fixture(params=MESHES)
def mesh(request: pytest.FixtureRequest) -> tuple[np.ndarray, np.ndarray]:
    return MESHES[request.param]


@pytest.fixture(params=["medium", "high"])
def bvh(request: pytest.FixtureRequest, mesh: tuple[np.ndarray, np.ndarray]) -> _cpu.Bvh:
    return _cpu.Bvh(*mesh, quality=request.param)


def test_every_triangle_is_in_exactly_one_leaf(mesh: tuple[np.ndarray, np.ndarray], bvh: _cpu.Bvh) -> None:
    blocks = [block for *_, child in walk(bvh) if child >= LEAF for block in leaf_blocks(bvh, child)]
    assert sorted(blocks) == list(range(len(bvh.blocks)))
    prims = bvh.blocks[:, 9].view(np.int32).ravel()
    assert sorted(prims[prims >= 0]) == list(range(len(mesh[1])))


def test_a_leaf_has_its_triangles_in_the_callers_order(bvh: _cpu.Bvh) -> None:
    for *_, child in walk(bvh):
        if child >= LEAF:
            prims = bvh.blocks[list(leaf_blocks(bvh, child)), 9].view(np.int32).ravel()
            used = prims >= 0
            assert used[: used.sum()].all()
            assert (np.diff(prims[used]) > 0).all()


def test_every_box_holds_its_triangles_and_its_childrens_boxes(
    mesh: tuple[np.ndarray, np.ndarray], bvh: _cpu.Bvh
) -> None:
    vertices, faces = mesh
    low, high = planes(bvh)
    used = used_lanes(bvh)
    for node, lane, _, child in walk(bvh):
        if child >= LEAF:
            prims = bvh.blocks[list(leaf_blocks(bvh, child)), 9].view(np.int32).ravel()
            inside = vertices[faces[prims[prims >= 0]]].astype(np.float64).reshape(-1, 3)
            lowest, highest = inside.min(axis=0), inside.max(axis=0)
        else:
            lanes = used[child // 64]
            lowest, highest = low[child // 64][lanes].min(axis=0), high[child // 64][lanes].max(axis=0)
        assert (low[node, lane] <= lowest).all()
        assert (high[node, lane] >= highest).all()


def test_blocks_hold_the_callers_vertices_bit_for_bit() -> None:
    vertices, faces = soup(500, seed=3)
    bvh = _cpu.Bvh(vertices, faces, accuracy="watertight")
    rows, prims = bvh.blocks[:, :9].view(np.float32), bvh.blocks[:, 9].view(np.int32)
    for block, lane in np.argwhere(prims >= 0):
        assert np.array_equal(rows[block, :, lane], vertices[faces[prims[block, lane]]].ravel())
    assert np.isnan(rows.transpose(0, 2, 1)[prims < 0]).all()


def test_order_is_a_permutation_and_the_opposite_octant_reverses_it(bvh: _cpu.Bvh) -> None:
    counts = used_lanes(bvh).sum(axis=1)
    for node, count in enumerate(counts):
        orders = [bvh.nodes[node, 7] >> np.uint32(4 * octant) & np.uint32(7) for octant in range(8)]
        for octant in range(8):
            assert sorted(orders[octant]) == list(range(8))
            assert list(orders[octant][:count]) == list(orders[7 - octant][:count][::-1])


def test_order_follows_the_split_axes() -> None:
    # A row of separate triangles along x: a ray along +x hits them by rising x, a ray along -x by falling x.
    vertices = np.concatenate([MESHES["one triangle"][0] + np.float32([10 * i, 0, 0]) for i in range(64)])
    bvh = _cpu.Bvh(vertices, np.arange(192, dtype=np.int32).reshape(-1, 3))
    low, _ = planes(bvh)
    for node in range(len(bvh.nodes)):
        used = int(used_lanes(bvh)[node].sum())
        forwards = bvh.nodes[node, 7] >> np.uint32(0) & np.uint32(7)
        assert (np.diff(low[node, forwards[:used], 0]) > 0).all()


@pytest.mark.parametrize("quality", ["medium", "high"])
def test_children_are_sorted_by_the_area_they_cover_per_size(quality: str) -> None:
    vertices, faces = soup(3000, seed=2)
    bvh = _cpu.Bvh(vertices, faces, quality=quality)
    low, high = planes(bvh)
    edges = vertices[faces[:, 1:]].astype(np.float64) - vertices[faces[:, :1]]
    areas = np.abs(np.cross(edges[:, 0], edges[:, 1])).sum(axis=1)  # twice the projected areas
    ways = walk(bvh)

    def prims(child: int) -> list[int]:
        if child < LEAF:
            return [prim for node, _, _, below in ways if node == child // 64 for prim in prims(below)]
        found = bvh.blocks[leaf_blocks(bvh, child), 9].view(np.int32)
        return found[found >= 0].tolist()

    worth: dict[int, list[float]] = {}
    for node, lane, _, child in sorted(ways):
        inside = prims(child)
        x, y, z = high[node, lane] - low[node, lane]
        worth.setdefault(node, []).append(areas[inside].sum() / (x * y + y * z + z * x) / len(inside) ** 0.5)
    assert len(worth) > 50
    for children in worth.values():
        assert np.all(np.diff(children) > -1e-4 * np.array(children[1:]))


def test_zero_area_triangles_are_left_out_and_keep_their_numbers() -> None:
    vertices = np.float32(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [0.1, 0.1, 0.1], [0.3, 0.3, 0.3], [0.7, 0.7, 0.7]]
    )
    faces = np.int32([[0, 0, 1], [0, 1, 2], [0, 1, 3], [4, 5, 5]])
    bvh = _cpu.Bvh(vertices, faces)
    prims = bvh.blocks[:, 9].view(np.int32)
    assert list(prims[prims >= 0]) == [1]


@pytest.mark.parametrize("quality", ["medium", "high"])
@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_the_tree_does_not_depend_on_threads(accuracy: str, quality: str) -> None:
    vertices, faces = soup(
        300_000, seed=4, size=0.01
    )  # enough triangles for ranges that all threads split together
    one, many = (_cpu.Bvh(vertices, faces, accuracy, threads=threads, quality=quality) for threads in (1, 5))
    assert np.array_equal(one.units, many.units)


@pytest.mark.parametrize("quality", ["medium", "high"])
def test_depth_keeps_its_limit_where_surface_area_would_peel_off_a_few_triangles_at_a_time(
    quality: str,
) -> None:
    # Small triangles at exponentially growing distances on three axes: each split takes off the last few.
    steps = 1.3 ** np.arange(-300.0, 150.0)
    small = np.array([[0, 0, 0], [1e-3, 0, 0], [0, 1e-3, 1e-3]])
    corners = np.concatenate([(small + np.eye(3)[axis]) * steps[:, None, None] for axis in range(3)])
    vertices, faces = corners.astype(np.float32).reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32)
    deep, shallow = (
        _cpu.Bvh(vertices, faces.reshape(-1, 3), depth_limit=limit, quality=quality) for limit in (64, 10)
    )
    assert 10 < deep.depth <= 64
    assert shallow.depth <= 10
    for bvh in (deep, shallow):
        assert bvh.depth == max(depth for _, _, depth, _ in walk(bvh))
        prims = bvh.blocks[:, 9].view(np.int32)
        assert (prims >= 0).sum() == len(corners)


def test_surface_area_cost_counts_nodes_and_blocks() -> None:
    bvh = _cpu.Bvh(*sphere(4))
    low, high = planes(bvh)
    size = high - low
    area = size[..., 0] * size[..., 1] + size[..., 1] * size[..., 2] + size[..., 2] * size[..., 0]
    extent = (bvh.bounds[1] - bvh.bounds[0]).astype(np.float64)
    root = extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]
    nodes, blocks = 1.0, 0.0
    for node, lane, _, child in walk(bvh):
        if child >= LEAF:
            blocks += len(leaf_blocks(bvh, child)) * area[node, lane] / root
        else:
            nodes += area[node, lane] / root
    assert bvh.sah == pytest.approx((nodes, blocks), rel=1e-6)


def test_the_largest_coordinates_make_a_sound_tree() -> None:
    random = np.random.default_rng(8)
    vertices = random.uniform(-9.9e17, 9.9e17, (6000, 3)).astype(np.float32)
    bvh = _cpu.Bvh(vertices, np.arange(6000, dtype=np.int32).reshape(-1, 3))
    prims = bvh.blocks[:, 9].view(np.int32)
    assert sorted(prims[prims >= 0]) == list(range(2000))


def test_a_sliver_that_is_not_quite_degenerate_is_kept_in_any_rotation() -> None:
    vertices = np.float32([[1, 0, 0], [1e-20, 1, 0], [2e-20, 1, 0]])
    for face in ([0, 1, 2], [1, 2, 0], [2, 0, 1]):
        assert (_cpu.Bvh(vertices, np.int32([face])).blocks[:, 9].view(np.int32) >= 0).sum() == 1
