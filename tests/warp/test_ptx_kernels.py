"""The CUDA code of every kind of kernel, run on the host from its PTX: bit for bit the hits of the core."""

import dataclasses
import itertools
import shutil

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.hard_rays import HARD_MESHES, hard_rays
from support.meshes import random_rays
from support.warp_launches import INFINITE, Answers, assert_bit_identical, cpu_answers, warp_answers

from bench.ptx import on_the_host
from bench.ptx.launching import COMPILER
from wive import _cpu, warp_kernels
from wive.warp_kernels.lanes.precision import PRECISIONS

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(shutil.which(COMPILER[0]) is None, reason=f"no C++ compiler {COMPILER[0]}"),
]

STACK = 96  # as in test_warp_cuda_aot.py, so that each kernel is compiled to PTX once
BEHIND = np.full(1, -np.inf, np.float32)  # hits behind the origin count: t of either sign

# query, accuracy, lanes, nodes, precision
KERNELS = [
    ("closest", "watertight", 8, "float32", "float32"),
    ("closest", "watertight", 1, "float32", "float32"),
    ("any", "fast", 1, "float32", "float32"),
    ("all", "watertight", 1, "float32", "float32"),
    ("closest", "exact", 1, "float32", "float32"),
    ("closest", "watertight", 1, "float32", "float64"),
    ("closest", "watertight", 8, "compressed", "float32"),
    ("count", "watertight", 1, "compressed", "float32"),
]
MESHES = ("sphere", "integer grid", "coincident")


def core_tree(mesh: str, accuracy: str, nodes: str, precision: str) -> _cpu.Bvh:
    vertices, faces = HARD_MESHES[mesh]()
    return _cpu.Bvh(vertices.astype(precision), faces, accuracy, nodes=nodes)


def rays_of(bvh: _cpu.Bvh, mesh: str) -> tuple[np.ndarray, np.ndarray]:
    faces = HARD_MESHES[mesh]()[1]
    rays = hard_rays(bvh.vertices, faces) if len(faces) else random_rays(50, 8)
    return rays[0].astype(bvh.vertices.dtype), rays[1].astype(bvh.vertices.dtype)


def launched(
    query: str, bvh: _cpu.Bvh, lanes: int, core: Answers, *rays: np.ndarray
) -> dict[str, np.ndarray]:
    """What the query's PTX writes; `core` has the counts that come before a list of all hits."""
    tree = dataclasses.replace(warp_kernels.upload(bvh, "cpu"), stack=STACK)
    numbers = PRECISIONS[tree.precision]
    dtypes = numbers.vec3, numbers.vec3, numbers.real, numbers.real
    given = [wp.array(values, dtype=dtype, device="cpu") for values, dtype in zip(rays, dtypes, strict=True)]

    def hits(prefix: str, count: int) -> dict[str, wp.array]:
        written = {"t": numbers.real, "prim": wp.int32, "uv": numbers.vec2}
        return {prefix + name: wp.zeros(count, dtype=dtype, device="cpu") for name, dtype in written.items()}

    with on_the_host():
        if query == "closest":
            outputs = hits("", len(core.t))
            warp_kernels.launch_closest(tree, *given, *outputs.values(), lanes=lanes)
        elif query == "all":
            outputs = hits("all_", len(core.all_t))
            left, offsets = wp.array(core.counts, device="cpu"), wp.array(core.offsets, device="cpu")
            warp_kernels.launch_all(tree, *given, left, offsets, *outputs.values(), lanes=lanes)
        else:
            name, dtype = {"any": ("occluded", wp.bool), "count": ("counts", wp.int32)}[query]
            outputs = {name: wp.zeros(len(core.t), dtype=dtype, device="cpu")}
            launch = {"any": warp_kernels.launch_any, "count": warp_kernels.launch_count}[query]
            launch(tree, *given, outputs[name], lanes=lanes)
    warp_kernels.check(tree)
    return {name: array.numpy() for name, array in outputs.items()}


@pytest.mark.parametrize(("query", "accuracy", "lanes", "nodes", "precision"), KERNELS)
def test_cuda_code_gives_the_bits_of_the_core(
    query: str, accuracy: str, lanes: int, nodes: str, precision: str
) -> None:
    for mesh in MESHES:
        bvh = core_tree(mesh, accuracy, nodes, precision)
        rays = *rays_of(bvh, mesh), BEHIND, INFINITE
        core = cpu_answers(bvh, "scalar", *rays)
        found = launched(query, bvh, lanes, core, *rays)
        assert_bit_identical(dataclasses.replace(core, **found), core, list(found))


@wp.kernel(module="unique", enable_backward=False)
def of_a_user(
    bvh: warp_kernels.Bvh,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    t: wp.array(dtype=wp.float32),
    prim: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
):
    i = wp.tid()
    hit = warp_kernels.closest_hit(bvh, origins[i], directions[i], -wp.inf, wp.inf)
    t[i] = hit.t
    prim[i] = hit.prim
    uv[i] = wp.vec2(hit.u, hit.v)


def test_cuda_code_of_a_users_kernel_gives_the_bits_of_the_core() -> None:
    """With Warp's default options: products and sums of the module may be fused."""
    for mesh in MESHES:
        bvh = core_tree(mesh, "watertight", "float32", "float32")
        rays = rays_of(bvh, mesh)
        given = [wp.array(rows, dtype=wp.vec3, device="cpu") for rows in rays]
        dtypes = {"t": wp.float32, "prim": wp.int32, "uv": wp.vec2}
        outputs = [wp.zeros(len(rays[0]), dtype=dtype, device="cpu") for dtype in dtypes.values()]
        tree = warp_kernels.upload(bvh, "cpu")
        with on_the_host():
            wp.launch(of_a_user, len(rays[0]), [tree.handle, *given], outputs, device="cpu")
        core = cpu_answers(bvh, "scalar", *rays, BEHIND, INFINITE)
        found = {name: array.numpy() for name, array in zip(dtypes, outputs, strict=True)}
        assert_bit_identical(dataclasses.replace(core, **found), core, list(found))


FORMS = [
    form
    for form in itertools.product(
        ("fast", "watertight", "exact"), (8, 1), ("float32", "compressed"), ("float32", "float64")
    )
    if (form[0], form[3]) != ("exact", "float64")  # exact scenes are of float32 vertices
]


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(("accuracy", "lanes", "nodes", "precision"), FORMS)
def test_cuda_code_of_every_query_and_form_gives_the_bits_and_steps_of_the_core(
    accuracy: str, lanes: int, nodes: str, precision: str
) -> None:
    for seed, mesh in enumerate(HARD_MESHES):
        bvh = core_tree(mesh, accuracy, nodes, precision)
        rays = *rays_of(bvh, mesh), BEHIND
        with on_the_host(seed=seed):
            found = warp_answers(bvh, lanes, *rays)
        assert_bit_identical(found, cpu_answers(bvh, "scalar", *rays))
