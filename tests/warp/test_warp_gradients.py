"""Gradients of a hit with respect to the ray and the vertices, against finite differences."""

import functools

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import sphere

from wive import _cpu, warp_kernels
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.tree.handle import HANDLES

pytestmark = pytest.mark.timeout(120)


@functools.cache
def weighing_kernel(accuracy: str, precision: str) -> wp.Kernel:
    """A kernel whose loss depends on t and the point, for one kind of tree."""
    real, vec3 = PRECISIONS[precision].real, PRECISIONS[precision].vec3

    @wp.kernel(module="unique")
    def weigh(
        bvh: HANDLES[accuracy, precision],
        vertices: wp.array(dtype=vec3),
        faces: wp.array(dtype=wp.vec3i),
        origins: wp.array(dtype=vec3),
        directions: wp.array(dtype=vec3),
        loss: wp.array(dtype=real),
    ):
        i = wp.tid()
        origin, direction = origins[i], directions[i]
        hit = warp_kernels.differentiable_hit(
            bvh, vertices, faces, origin, direction, real(0.0), real(wp.inf)
        )
        if hit.prim >= 0:
            loss[i] = hit.t + wp.dot(vec3(real(0.5), real(-1.0), real(2.0)), hit.point)

    return weigh


# Accuracy and precision, and how far gradients may be off.
KINDS = [("watertight", "float32", 1e-3), ("fast", "float32", 1e-3), ("watertight", "float64", 1e-7)]


def exact_loss(triangle: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """The kernel's loss in float64 on one triangle."""
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    t = normal @ (triangle[0] - origin) / (normal @ direction)
    return float(t + np.array([0.5, -1.0, 2.0]) @ (origin + t * direction))


def slopes(triangle: np.ndarray, origin: np.ndarray, direction: np.ndarray, which: int) -> np.ndarray:
    """Central differences of the exact loss with respect to one of the three arguments."""
    arguments = [triangle, origin, direction]
    result = np.zeros_like(arguments[which])
    for place in np.ndindex(result.shape):
        ends = []
        for sign in (1, -1):
            moved = [argument.copy() for argument in arguments]
            moved[which][place] += sign * 1e-6
            ends.append(exact_loss(*moved))
        result[place] = (ends[0] - ends[1]) / 2e-6
    return result


@pytest.mark.parametrize(("accuracy", "precision", "tolerance"), KINDS)
def test_gradients_of_distance_and_point_are_those_of_finite_differences(
    accuracy: str, precision: str, tolerance: float
) -> None:
    vertices, faces = sphere(1)
    vertices = vertices.astype(precision)
    numbers = PRECISIONS[precision]
    random = np.random.default_rng(5)
    toward = random.standard_normal((12, 3))
    origins = (3 * toward / np.linalg.norm(toward, axis=1, keepdims=True)).astype(precision)
    directions = (0.3 * random.standard_normal((12, 3)) - origins).astype(precision)
    origins[0], directions[0] = (5, 5, 5), (1, 1, 1)  # misses: no gradient at all

    tree = warp_kernels.upload(_cpu.Bvh(vertices, faces, accuracy), "cpu")
    arrays = [
        wp.array(vertices, dtype=numbers.vec3, device="cpu", requires_grad=True),
        wp.array(faces, dtype=wp.vec3i, device="cpu"),
        wp.array(origins, dtype=numbers.vec3, device="cpu", requires_grad=True),
        wp.array(directions, dtype=numbers.vec3, device="cpu", requires_grad=True),
    ]
    loss = wp.zeros(len(origins), dtype=numbers.real, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        kernel = weighing_kernel(accuracy, precision)
        wp.launch(kernel, len(origins), inputs=[tree.handle, *arrays], outputs=[loss], device="cpu")
    tape.backward(grads={loss: wp.ones_like(loss)})
    warp_kernels.check(tree)
    got = [tape.gradients[arrays[i]].numpy() for i in (0, 2, 3)]

    wanted = [np.zeros((len(vertices), 3)), np.zeros_like(got[1]), np.zeros_like(got[2])]
    limits = np.zeros(1, precision), np.full(1, np.inf, precision)
    prim = _cpu.Bvh(vertices, faces, accuracy).intersect("scalar", origins, directions, *limits)[1]
    assert (prim >= 0).sum() >= 8
    for i in np.flatnonzero(prim >= 0):
        corners = faces[prim[i]]
        one = (
            vertices[corners].astype(np.float64),
            origins[i].astype(np.float64),
            directions[i].astype(np.float64),
        )
        np.add.at(wanted[0], corners, slopes(*one, 0))
        wanted[1][i], wanted[2][i] = slopes(*one, 1), slopes(*one, 2)
    for mine, exact in zip(got, wanted, strict=True):
        np.testing.assert_allclose(mine, exact, rtol=tolerance, atol=tolerance)
    assert not got[1][0].any()
