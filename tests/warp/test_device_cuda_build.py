"""The CUDA code for pictures and hits compiles without a device, and rounds like the CPU."""

import re

import pytest

wp = pytest.importorskip("warp")

from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.scene import hits as warp_hits
from wive.warp_kernels.scene import shading as warp_shading
from wive.warp_kernels.scene import sides as warp_sides
from wive.warp_kernels.scene import spawn as warp_spawn

ARCHITECTURES = (80, 90, 100)
ARITHMETIC = re.compile(r"\b(?:add|sub|mul|fma|mad|div|rcp|sqrt|rsqrt)\.[a-z0-9.]*f(?:32|64)\b")


def modules() -> dict[str, tuple[wp.Module, tuple[str, ...]]]:
    """What is compiled together, and the kernels in it."""
    found = {"shading": (wp.get_module(warp_shading.__name__), ("start_paths", "shade", "accumulate"))}
    for precision in PRECISIONS:
        found[f"hits {precision}"] = (
            warp_hits.hit_kernels(precision).points.module,
            ("mask", "points", "normals"),
        )
        kernels = warp_spawn.bounds_kernel(precision), warp_spawn.spawn_kernel(precision)
        found[f"sides {precision}"] = warp_sides.side_kernels(precision).front.module, ("front", "cosines")
        found[f"spawn {precision}"] = kernels[0].module, ("bound_errors", "spawn_origins")
    return found


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("name", modules())
def test_every_operation_is_rounded_on_its_own_on_cuda(tmp_path, name, architecture):
    module, kernels = modules()[name]
    wp.compile_aot_module(module, arch=architecture, module_dir=tmp_path, use_ptx=True)
    (ptx,) = (path.read_text() for path in tmp_path.glob("*.ptx"))
    for kernel in kernels:
        assert re.search(rf"\.entry \w*{kernel}_\w+_cuda_kernel_forward\(", ptx)
    found = set(ARITHMETIC.findall(ptx))
    # PTX writes "rn" for a single rounding to nearest; add and sub without it may be fused with a mul.
    assert any(operation.startswith("sqrt.rn") for operation in found)
    assert not [name for name in found if ".rn." not in name or name.startswith(("fma", "mad"))]
