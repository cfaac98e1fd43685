"""What CUDA devices run for pictures and hits compiles without one, and rounds as the CPU does."""

import re

import pytest

wp = pytest.importorskip("warp")

ARCHITECTURES = (80, 90, 100)
ARITHMETIC = re.compile(r"\b(?:add|sub|mul|fma|mad|div|rcp|sqrt|rsqrt)\.[a-z0-9.]*f(?:32|64)\b")


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize(
    ("name", "kernels"),
    [
        ("warp_shading", ("start_paths", "shade", "gather")),
        ("warp_hits", ("_points",)),
        ("warp_spawn", ("_error_bounds", "_spawn_origins")),
    ],
)
def test_every_operation_is_rounded_on_its_own_on_cuda(tmp_path, name, kernels, architecture):
    module = pytest.importorskip(f"wive.{name}")
    wp.compile_aot_module(module, arch=architecture, module_dir=tmp_path, use_ptx=True)
    (ptx,) = (path.read_text() for path in tmp_path.glob("*.ptx"))
    for kernel in kernels:
        assert re.search(rf"\.entry {kernel}_\w+_cuda_kernel_forward\(", ptx)
    found = set(ARITHMETIC.findall(ptx))
    # PTX writes "rn" where it rounds once to nearest; add and sub without it may be fused with a mul.
    assert any(operation.startswith("sqrt.rn") for operation in found)
    assert not [name for name in found if ".rn." not in name or name.startswith(("fma", "mad"))]
