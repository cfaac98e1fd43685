"""Gradients of a hit with respect to the ray and the vertices, against finite differences."""

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import sphere

from wive import _cpu, warp_kernels

pytestmark = pytest.mark.timeout(120)


def weighing_kernel(handle: type) -> wp.Kernel:
    """A kernel whose loss depends on t and the point, for one type of handle."""

    @wp.kernel(module="unique")
    def weigh(
        bvh: handle,
        vertices: wp.array(dtype=wp.vec3),
        faces: wp.array(dtype=wp.vec3i),
        origins: wp.array(dtype=wp.vec3),
        directions: wp.array(dtype=wp.vec3),
        loss: wp.array(dtype=wp.float32),
    ):
        i = wp.tid()
        hit = warp_kernels.differentiable_hit(bvh, vertices, faces, origins[i], directions[i], 0.0, wp.inf)
        if hit.prim >= 0:
            loss[i] = hit.t + wp.dot(wp.vec3(0.5, -1.0, 2.0), hit.point)

    return weigh


KERNELS = {
    "watertight": weighing_kernel(warp_kernels.Bvh),
    "fast": weighing_kernel(warp_kernels.FastBvh),
}


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


@pytest.mark.parametrize("accuracy", KERNELS)
def test_gradients_of_distance_and_point_are_those_of_finite_differences(accuracy: str) -> None:
    vertices, faces = sphere(1)
    random = np.random.default_rng(5)
    toward = random.standard_normal((12, 3))
    origins = (3 * toward / np.linalg.norm(toward, axis=1, keepdims=True)).astype(np.float32)
    directions = (0.3 * random.standard_normal((12, 3)) - origins).astype(np.float32)
    origins[0], directions[0] = (5, 5, 5), (1, 1, 1)  # misses: no gradient at all

    tree = warp_kernels.upload(_cpu.Bvh(vertices, faces, accuracy), "cpu")
    arrays = [
        wp.array(vertices, dtype=wp.vec3, device="cpu", requires_grad=True),
        wp.array(faces, dtype=wp.vec3i, device="cpu"),
        wp.array(origins, dtype=wp.vec3, device="cpu", requires_grad=True),
        wp.array(directions, dtype=wp.vec3, device="cpu", requires_grad=True),
    ]
    loss = wp.zeros(len(origins), dtype=wp.float32, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(
            KERNELS[accuracy], len(origins), inputs=[tree.handle, *arrays], outputs=[loss], device="cpu"
        )
    tape.backward(grads={loss: wp.ones_like(loss)})
    warp_kernels.check(tree)
    got = [tape.gradients[arrays[i]].numpy() for i in (0, 2, 3)]

    wanted = [np.zeros((len(vertices), 3)), np.zeros_like(got[1]), np.zeros_like(got[2])]
    infinite = np.full(1, np.inf, np.float32)
    hits = _cpu.Bvh(vertices, faces, accuracy).intersect(
        "scalar", origins, directions, np.zeros(1, np.float32), infinite
    )
    prim = hits[1]
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
        np.testing.assert_allclose(mine, exact, rtol=1e-3, atol=1e-3)
    assert not got[1][0].any()
