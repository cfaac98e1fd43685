"""float64 trees of the core, on every kernel and node form: results that float32 can't give."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from support.float64_trees import (
    ACCURACIES,
    NODES,
    PLACES,
    UTM,
    closest,
    each_form,
    each_kernel,
    exact_hits,
    kernels,
    leaving,
    query,
    soup,
    sphere64,
)
from support.meshes import sphere

from wive import _cpu


def same(a: tuple[np.ndarray, ...], b: tuple[np.ndarray, ...]) -> bool:
    return all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b, strict=True))


@each_form
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_kernels_threads_and_rays_in_flight_give_the_same_bits(accuracy: str, nodes: str) -> None:
    random = np.random.default_rng(1)
    vertices, faces = soup(3000, 0.1, random)
    vertices += UTM
    bvh = _cpu.Bvh(vertices, faces, accuracy, nodes=nodes)
    origins = UTM + random.uniform(-1.5, 1.5, (3000, 3))
    directions = random.standard_normal((3000, 3))
    directions[::3] = vertices[faces[random.integers(len(faces), size=1000)], :][:, 1] - origins[::3]
    directions[1::5, random.integers(3)] = 0.0
    tmin, tmax = random.uniform(0, 0.2, 3000), random.uniform(0.5, 4, 3000)
    expected = None
    for kernel in kernels():
        for in_flight, threads in ((1, 1), (2, 1), (24, 2), (64, 1)):
            options = {"in_flight": in_flight, "threads": threads, "stats": True}
            answers = [
                answer
                for name in ("intersect", "occluded", "intersect_all", "count")
                for answer in query(bvh, kernel, name, origins, directions, tmin, tmax, **options)
            ]
            expected = expected or answers
            assert same(tuple(answers), tuple(expected)), (kernel, in_flight)
    assert expected is not None
    assert (expected[1] >= 0).mean() > 0.5 and expected[0].dtype == expected[2].dtype == np.float64


@each_kernel
def test_compressed_nodes_give_the_same_hits(kernel: str) -> None:
    random = np.random.default_rng(10)
    vertices, faces = soup(5000, 0.2, random)
    vertices[:, 2] *= 1e-13  # nearly in one plane, and seen edge-on by half of the rays
    float32_nodes, compressed = (_cpu.Bvh(vertices + UTM, faces, nodes=nodes) for nodes in NODES)
    assert compressed.memory < float32_nodes.memory
    origins = random.uniform(-1, 1, (1000, 3))
    directions = random.standard_normal((1000, 3))
    origins[::2, 2] *= 1e-13
    directions[::2, 2] *= 1e-13
    for name in ("intersect", "occluded", "intersect_all", "count"):
        answers = [
            query(tree, kernel, name, origins + UTM, directions) for tree in (float32_nodes, compressed)
        ]
        assert same(*(answer[:-1] for answer in answers))


@pytest.mark.parametrize("place", PLACES[:2])
def test_hits_are_those_of_rational_arithmetic(place: tuple[float, ...]) -> None:
    random = np.random.default_rng(2)
    vertices, faces = soup(40, 0.5, random)
    mesh = vertices + np.asarray(place), faces
    origins = np.asarray(place) + random.uniform(-2, 2, (150, 3))
    directions = mesh[0][random.integers(len(vertices), size=150)] - origins
    directions += 0.2 * random.standard_normal((150, 3))
    exact = [
        [hit for hit in exact_hits(mesh, origins[ray], directions[ray]) if hit[0] >= 0] for ray in range(150)
    ]
    sure = [ray for ray in range(150) if all(least > Fraction(1, 10**9) for _, _, least in exact[ray])]
    assert sum(len(exact[ray]) for ray in sure) > 150
    for accuracy, nodes, kernel in itertools.product(ACCURACIES, NODES, kernels()):
        bvh = _cpu.Bvh(*mesh, accuracy, nodes=nodes)
        t, prim, _ = closest(bvh, kernel, origins, directions)
        offsets, every_t, every_prim, _, _ = query(bvh, kernel, "intersect_all", origins, directions)
        for ray in sure:
            rows = slice(offsets[ray], offsets[ray + 1])
            assert every_prim[rows].tolist() == [number for _, number, _ in exact[ray]]
            assert prim[ray] == (exact[ray][0][1] if exact[ray] else -1)
            assert t[ray] == (every_t[offsets[ray]] if exact[ray] else np.inf)
            for measured, (true, _, _) in zip(every_t[rows], exact[ray], strict=True):
                # 64 units in the last place, the largest error from these directions
                assert abs(Fraction(measured) - true) <= 64 * Fraction(2) ** -53 * max(true, 1)


@each_kernel
@each_form
@pytest.mark.parametrize("place", [0.0, 1000.0, -3e6])
def test_float64_refines_the_hits_of_float32_numbers(kernel: str, nodes: str, place: float) -> None:
    random = np.random.default_rng(5)
    vertices, faces = sphere(5)
    vertices = (vertices * 100 + place).astype(np.float32)
    origins, directions = (
        a.astype(np.float32) for a in leaving((vertices.astype(np.float64), faces), "faces", 4000, random)
    )
    directions += random.uniform(-0.3, 0.3, directions.shape).astype(np.float32)
    narrow, wide = (
        _cpu.Bvh(vertices.astype(dtype), faces, nodes=nodes) for dtype in (np.float32, np.float64)
    )
    assert np.array_equal(narrow.center, wide.center) and np.array_equal(narrow.bounds, wide.bounds)
    if place == 0.0 and nodes == "float32":  # the same boxes; their order depends on areas, which are rounded
        boxes = [sorted(tree.nodes[:, :6].swapaxes(1, 2).reshape(-1, 6).tolist()) for tree in (narrow, wide)]
        assert boxes[0] == boxes[1]
    t32, prim32, _ = closest(narrow, kernel, origins, directions)
    t64, prim64, _ = closest(wide, kernel, origins.astype(np.float64), directions.astype(np.float64))
    assert (prim32 >= 0).all()
    assert (prim32 == prim64).mean() > 0.99  # rays near edges may take the neighbour
    alike = prim32 == prim64
    assert np.array_equal(t32[alike], t64[alike].astype(np.float32))


@each_form
@pytest.mark.parametrize("place", PLACES)
def test_boxes_hold_their_triangles_in_exact_arithmetic(nodes: str, place: tuple[float, ...]) -> None:
    vertices, faces = soup(60, 0.3, np.random.default_rng(6))
    vertices = vertices * 1e-2 * max(1.0, np.abs(place).max() * 1e-9) + np.asarray(place)
    bvh = _cpu.Bvh(vertices, faces, nodes=nodes)
    stored = bvh.nodes.view(np.float32)
    children = bvh.nodes[:, 6] if nodes == "float32" else bvh.nodes.reshape(len(stored), 32)[:, 24:]
    first = 8 * len(bvh.nodes) * (1 if nodes == "float32" else 0.5)
    held = 0
    for node in range(len(stored)):
        for lane in range(8):
            child = int(children[node, lane])
            if not child >> 31 or child == 0xFFFFFFFF:
                continue
            if nodes == "float32":
                planes = [Fraction(float(p)) for p in stored[node, :6, lane]]
            else:
                words = bvh.nodes[node].reshape(-1)
                base, step = words[:3].view(np.float32), words[3:6].view(np.float32)
                bytes_ = words[6:18].view(np.uint8).reshape(6, 8)[:, lane]
                planes = [
                    Fraction(float(base[i // 2])) + Fraction(float(step[i // 2])) * int(bytes_[i])
                    for i in range(6)
                ]
            block = int(((child & 0x7FFFFFFF) >> 3) - first) // 10
            for prim in bvh.blocks[block : block + (child & 7) + 1, 18].astype(np.int32).ravel():
                for corner in vertices[faces[prim]] if prim >= 0 else ():
                    held += 1
                    for axis in range(3):
                        relative = Fraction(corner[axis]) - Fraction(float(bvh.center[axis]))
                        assert planes[2 * axis] <= relative <= planes[2 * axis + 1]
    assert held == 3 * len(faces)


def test_a_triangle_has_an_area_where_exact_arithmetic_finds_one() -> None:
    third = np.float64(1) / 3
    line = np.array([[0, 0, 0], [third, third, third], [3 * third, 3 * third, 3 * third]])
    bent = line.copy()
    bent[2, 2] = np.nextafter(bent[2, 2], 2)
    face = np.int32([[0, 1, 2]])
    assert np.isinf(_cpu.Bvh(line, face).bounds).all()
    assert np.array_equal(_cpu.Bvh(bent, face).bounds, [[0, 0, 0], bent[2]])
    far = line * np.float64(7) + 0.1  # rounding makes it uneven, by an amount that only rationals give
    exact = [[Fraction(x) for x in v] for v in far]
    sides = [[b - a for a, b in zip(exact[0], exact[k], strict=True)] for k in (1, 2)]
    area = any(sides[0][i - 2] * sides[1][i - 1] != sides[0][i - 1] * sides[1][i - 2] for i in range(3))
    assert np.isfinite(_cpu.Bvh(far, face).bounds).all() == area


@each_kernel
@each_form
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_a_refitted_tree_answers_as_a_new_one(kernel: str, nodes: str, accuracy: str) -> None:
    vertices, faces = sphere64(4, 1.0, UTM)
    bvh = _cpu.Bvh(vertices, faces, accuracy, nodes=nodes)
    moved = vertices + 0.01 * np.sin(40 * vertices) + 1000.25
    refitted, new = bvh.refitted(moved), _cpu.Bvh(moved, faces, accuracy, nodes=nodes)
    assert refitted.precision == "float64" and np.array_equal(refitted.bounds, new.bounds)
    assert np.array_equal(refitted.center, new.center)
    rays = leaving((moved, faces), "faces", 2000, np.random.default_rng(9))
    assert same(closest(refitted, kernel, *rays), closest(new, kernel, *rays))
    flat = moved.copy()
    flat[faces[7]] = flat[faces[7][0]]
    again = bvh.refitted(flat).refitted(moved)
    assert same(closest(again, kernel, *rays), closest(new, kernel, *rays))


def test_the_blocks_hold_the_callers_numbers() -> None:
    vertices, faces = sphere64(2, 1.0, UTM)
    for nodes in NODES:
        for accuracy in ACCURACIES:
            bvh = _cpu.Bvh(vertices, faces, accuracy, nodes=nodes)
            assert bvh.precision == "float64" and bvh.vertices is not None
            blocks = bvh.blocks
            assert blocks.shape[1:] == (20, 4) and not blocks[:, 19].any()
            prims = blocks[:, 18].astype(np.int32).ravel()
            rows = blocks.reshape(-1, 80)[:, :72].copy().view(np.float64).reshape(-1, 9, 4)
            corners = rows.transpose(0, 2, 1).reshape(-1, 3, 3)[prims >= 0]
            expected = vertices[faces[prims[prims >= 0]]]
            if accuracy == "fast":
                expected = expected - np.pad(expected[:, :1], ((0, 0), (1, 1), (0, 0)), mode="edge") * [
                    [[0], [1], [1]]
                ]
            assert np.array_equal(corners, expected)
            assert sorted(prims[prims >= 0]) == list(range(len(faces)))


def test_points_and_normals_of_hits_are_those_of_the_double_corners() -> None:
    vertices, faces = sphere64(3, 1.0, UTM)
    prim = np.arange(-1, len(faces), dtype=np.int32)
    uv = np.full((len(prim), 2), 0.25)
    points = _cpu.surface_points(vertices, faces, prim, uv)
    corners = vertices[faces]
    expected = 0.5 * corners[:, 0] + 0.25 * corners[:, 1] + 0.25 * corners[:, 2]
    assert np.isnan(points[0]).all() and np.array_equal(points[1:], expected)
    normals = _cpu.surface_normals(vertices, faces, prim)
    outwards = corners.mean(axis=1) - UTM
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    assert (np.sum(normals[1:] * outwards, axis=1) > 0.99).all()


def test_arguments_that_float64_trees_do_not_take_are_refused_in_one_line() -> None:
    vertices, faces = sphere64(1)
    with pytest.raises(ValueError, match=r"accuracy: 'exact' takes vertices in float32"):
        _cpu.Bvh(vertices, faces, "exact")
    bad = vertices.copy()
    bad[5, 1] = 1.1e18
    with pytest.raises(ValueError, match=r"vertices\[5\] = .*at most 1e18"):
        _cpu.Bvh(bad, faces)
    bad[5, 1] = 1e18
    assert _cpu.Bvh(bad, faces).bounds[1, 1] == 1e18
    bad[3, 2] = np.nan
    with pytest.raises(ValueError, match=r"vertices\[3\]"):
        _cpu.Bvh(bad, faces)
    bvh = _cpu.Bvh(vertices, faces)
    rays = np.zeros((1, 3)), np.ones((1, 3))
    narrow = [a.astype(np.float32) for a in rays]
    with pytest.raises(ValueError, match=r"float64"):
        closest(bvh, "scalar", *narrow)
    with pytest.raises(ValueError, match=r"float32"):
        closest(_cpu.Bvh(vertices.astype(np.float32), faces), "scalar", *rays)
    with pytest.raises(ValueError, match=r"float64"):
        bvh.refitted(vertices.astype(np.float32))
    with pytest.raises(ValueError, match=r"render: expected a float32 scene"):
        bvh.render_rows(
            "scalar", np.zeros((4, 3), np.float32), np.zeros((2, 2, 3), np.float32), 0, 2, 1, 1, "gray"
        )
    usable = _cpu.kernels()
    if not usable["avx512.half"]:
        with pytest.raises(ValueError, match=r"'avx512.half' traces float32 scenes only"):
            closest(bvh, "avx512.half", *rays)
