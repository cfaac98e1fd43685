"""Error bounds and spawned origins on Warp's CPU device, hit by hit, have the bits of the core's lanes."""

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.surface_calls import bits, calls

from wive import _cpu
from wive._internal import error_bounds, spawn
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.scene import spawn as on_warp

pytestmark = pytest.mark.timeout(180)


def launch(kernel: object, inputs: list[object], out: np.ndarray, vec: type | None = None) -> np.ndarray:
    """`out`, written by a kernel with one thread per row."""
    rows = wp.array(out, dtype=vec or wp.float64, device="cpu")
    wp.launch(kernel, len(out), inputs=inputs, outputs=[rows], device="cpu")
    return rows.numpy()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_one_hit_at_a_time_has_the_bits_of_lanes(dtype: type) -> None:
    name = np.dtype(dtype).name
    numbers = PRECISIONS[name]
    (vertices, faces), *given = calls(dtype, 1)
    mesh = wp.array(vertices, dtype=numbers.vec3, device="cpu"), wp.array(faces, dtype=wp.vec3i, device="cpu")
    for hits in given:
        prim, uv, directions, t, origins = hits
        if not len(prim):
            continue
        dtypes = wp.int32, numbers.vec2, numbers.vec3, numbers.real, numbers.vec3
        prims, weights, along, distances, starts = (
            wp.array(rows, dtype=kind, device="cpu") for rows, kind in zip(hits, dtypes, strict=True)
        )
        for accuracy in range(len(spawn.ACCURACIES)):
            found = launch(
                on_warp.spawn_kernel(name),
                [*mesh, prims, weights, along, accuracy, on_warp.spawn_constants(name)],
                np.zeros((len(prim), 3), dtype),
                numbers.vec3,
            )
            expected = _cpu.spawn_origins(
                vertices, faces, prim, uv, directions, accuracy, spawn.ROUNDINGS[name]
            )
            np.testing.assert_array_equal(bits(found), bits(expected))
        found = launch(
            on_warp.bounds_kernel(name),
            [*mesh, prims, distances, starts, along, on_warp.bound_constants(name)],
            np.zeros(len(prim)),
        )
        expected = _cpu.error_bounds(
            vertices, faces, prim, t, origins, directions, error_bounds.constants(name)
        )
        np.testing.assert_array_equal(bits(found), bits(expected))
