"""What fine detail costs does not depend on the size of the scene around it."""

import numpy as np
import pytest
from support.meshes import sphere

import wive

RADIUS = 0.1
SIZES = (2.0, 2e3, 2e4, 2e5)  # of the ground under the ball


def ball_above_ground(size: float, dtype: type) -> tuple[np.ndarray, np.ndarray]:
    """A fine ball in the middle of one large triangle."""
    vertices, faces = sphere(6)
    half = size / 2
    ground = [[-half, -half, -0.3], [half, -half, -0.3], [0, half, -0.3]]
    count = len(vertices)
    return (
        np.vstack([vertices * RADIUS, ground]).astype(dtype),
        np.vstack([faces, [[count, count + 1, count + 2]]]).astype(np.int32),
    )


def rays_at_ball(dtype: type) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(71)
    out = random.normal(size=(400, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    aims = random.uniform(-0.5, 0.5, (400, 3)) * RADIUS
    origins = (out * 0.5).astype(dtype)
    return origins, (aims - origins).astype(dtype)


@pytest.mark.parametrize(
    ("accuracy", "dtype", "nodes"),
    [
        (accuracy, dtype, nodes)
        for accuracy in ("fast", "watertight", "exact")
        for dtype in (np.float32, np.float64)
        for nodes in ("float32", "compressed")
        if accuracy == "watertight" or (dtype is np.float32 and (accuracy == "exact" or nodes == "float32"))
    ],
)
def test_steps_do_not_grow_with_the_scene(accuracy: str, dtype: type, nodes: str) -> None:
    origins, directions = rays_at_ball(dtype)
    steps, prims = [], []
    for size in SIZES:
        scene = wive.Scene(*ball_above_ground(size, dtype), accuracy=accuracy, nodes=nodes)
        hits, stats = scene.intersect(origins, directions, stats=True)
        steps.append(float(stats.inner_nodes.mean() + stats.leaves.mean()))
        prims.append(hits.prim)
    # A compressed node that holds the ground has no bytes left to tell apart the small boxes beside it.
    most = 2.0 if nodes == "compressed" else 1.2
    assert max(steps) < most * steps[0]
    assert all((prim == prims[0]).all() for prim in prims)
