"""Points, normals, error bounds and spawned origins have the same bits on every instruction set."""

from collections.abc import Iterator

import numpy as np
import pytest
from support.surface_calls import bits, calls, instruction_sets

from wive import _cpu
from wive._internal import error_bounds, spawn

KERNELS = instruction_sets()


def answers(dtype: type, seed: int, kernel: str) -> Iterator[np.ndarray]:
    mesh, *given = calls(dtype, seed)
    name = np.dtype(dtype).name
    for prim, uv, directions, t, origins in given:
        yield _cpu.surface_points(*mesh, prim, uv, kernel)
        yield _cpu.surface_normals(*mesh, prim, kernel)
        yield _cpu.error_bounds(*mesh, prim, t, origins, directions, error_bounds.constants(name), kernel)
        for accuracy in range(len(spawn.ACCURACIES)):
            yield _cpu.spawn_origins(*mesh, prim, uv, directions, accuracy, spawn.ROUNDINGS[name], kernel)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("kernel", KERNELS)
def test_instruction_sets_give_the_same_bits(kernel: str, dtype: type) -> None:
    for seed in range(4):
        expected = answers(dtype, seed, "")
        for found, best in zip(answers(dtype, seed, kernel), expected, strict=True):
            np.testing.assert_array_equal(bits(found), bits(best))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_hit_has_the_same_bits_among_others_and_alone(dtype: type) -> None:
    mesh, *given = calls(dtype, 5)
    rounding = spawn.ROUNDINGS[np.dtype(dtype).name]
    prim, uv, directions, *_ = given[-1]
    together = _cpu.spawn_origins(*mesh, prim, uv, directions, 1, rounding)
    for i in range(0, len(prim), 7):
        one = slice(i, i + 1)
        alone = _cpu.spawn_origins(*mesh, prim[one], uv[one], directions[one], 1, rounding)
        np.testing.assert_array_equal(bits(alone), bits(together[one]))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_only_hits_without_a_triangle_have_no_origin_and_some_origins_are_hard_to_round(dtype: type) -> None:
    mesh, *given = calls(dtype, 0)
    prim, uv, directions, *_ = given[-1]
    origins = _cpu.spawn_origins(*mesh, prim, uv, directions, 2, spawn.ROUNDINGS[np.dtype(dtype).name])
    assert np.isnan(origins[(prim < 0) | (prim == len(mesh[1]))]).all()
    assert np.isfinite(origins).mean() > 0.4 and np.isinf(origins).any()
    if dtype is np.float32:  # triangles as small in double have no area
        assert (np.signbit(origins) & (origins == 0)).any()
        assert ((abs(origins) < np.finfo(dtype).tiny) & (origins != 0)).any()


def test_an_unknown_kernel_is_named() -> None:
    mesh, (prim, *_), *_ = calls(np.float32, 0)
    with pytest.raises(ValueError, match=r"^unknown kernel 'avx3'$"):
        _cpu.surface_normals(*mesh, prim, "avx3")
