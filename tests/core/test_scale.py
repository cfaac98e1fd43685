"""What fine detail costs does not depend on the size of the scene around it."""

import numpy as np
import pytest
from support.exact_answers import wrong_rays
from support.meshes import sphere
from support.oracle import Truth, truth

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


FAR = [
    (dtype, accuracy, nodes)
    for dtype, accuracies in (
        (np.float32, ("fast", "watertight", "exact")),
        (np.float64, ("fast", "watertight")),
    )
    for accuracy in accuracies
    for nodes in ("float32", "compressed")
    if nodes == "float32" or accuracy == "watertight"
]


@pytest.mark.parametrize(("dtype", "accuracy", "nodes"), FAR)
def test_steps_do_not_grow_with_the_distance(dtype: type, accuracy: str, nodes: str) -> None:
    scene = wive.Scene(*ball_above_ground(2, dtype), accuracy=accuracy, nodes=nodes)
    near, directions = rays_at_ball(np.float64)
    steps = []
    for distance in (0.5, 1e2, 1e4, 1e5, 1e6, 1e8):
        aims = near + directions
        away = near / np.linalg.norm(near, axis=1, keepdims=True) * distance
        origins = away.astype(dtype)
        if accuracy == "exact":  # takes the ray as it is, which float32 moves off the ball from far away
            aims = np.zeros_like(aims) if distance > 1e4 else aims
        _, stats = scene.intersect(origins, (aims - origins).astype(dtype), stats=True)
        steps.append(float(stats.inner_nodes.mean() + stats.leaves.mean()))
    # `exact` keeps t as the float32 that it is rounded to, so what lies behind a hit can't all be skipped.
    assert max(steps) < (4 if accuracy == "exact" else 1.5) * steps[0]


def rays_from(distance: float, vertices: np.ndarray, dtype: type) -> tuple[np.ndarray, np.ndarray]:
    """Rays of any length at vertices of a ball around zero, and through its middle."""
    random = np.random.default_rng(72)
    away = random.normal(size=(60, 3))
    away[:6] = np.concatenate([np.eye(3), -np.eye(3)])
    origins = (away / np.linalg.norm(away, axis=1, keepdims=True) * distance).astype(dtype)
    aims = vertices[random.integers(len(vertices), size=60)]
    aims[::2] *= 1e-3
    return origins, ((aims - origins) * 10.0 ** random.uniform(-3, 3, (60, 1))).astype(dtype)


@pytest.mark.parametrize("distance", [1e3, 1e6, 1e9, 1e12])
def test_exact_hits_from_far_away_are_those_of_rational_numbers(distance: float) -> None:
    vertices, faces = (
        array.astype(dtype) for array, dtype in zip(sphere(1), (np.float32, np.int32), strict=True)
    )
    origins, directions = rays_from(distance, vertices, np.float32)
    scene = wive.Scene(vertices, faces, accuracy="exact")
    t = scene.intersect(origins, directions).t
    for tmin, tmax in ((np.zeros(60), np.full(60, np.inf)), (np.where(t < np.inf, t, 0), np.full(60, np.inf)),
                       (np.full(60, -np.inf), t), (-t, np.nextafter(t, np.float32(0)))):  # fmt: skip
        right = truth(vertices, faces, origins, directions, tmin.astype(np.float32), tmax.astype(np.float32))
        hits = scene.intersect(origins, directions, tmin, tmax)
        found = Truth(hits.t, hits.prim, hits.uv, scene.occluded(origins, directions, tmin, tmax))
        assert len(wrong_rays(found, right)) == 0


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_float64_hits_from_far_away_are_those_of_every_triangle_alone(accuracy: str, nodes: str) -> None:
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces, accuracy=accuracy, nodes=nodes, dtype="float64")
    alone = [
        wive.Scene(vertices, faces[i : i + 1], accuracy=accuracy, dtype="float64") for i in range(len(faces))
    ]
    for distance in (1e3, 1e6, 1e9):
        origins, directions = rays_from(distance, vertices, np.float64)
        first = scene.intersect(origins, directions).t
        assert (first[::2] < np.inf).all()
        for tmin, tmax in ((0, np.inf), (first, np.inf), (-np.inf, first), (0, np.nextafter(first, 0))):
            every = scene.intersect_all(origins, directions, tmin, tmax, touching=True)
            found = [one.intersect_all(origins, directions, tmin, tmax, touching=True) for one in alone]
            ray, t = np.concatenate([hits.ray for hits in found]), np.concatenate([hits.t for hits in found])
            prim = np.repeat(np.arange(len(faces)), [len(hits.t) for hits in found])
            order = np.lexsort((prim, t, ray))
            np.testing.assert_array_equal(every.ray, ray[order])
            np.testing.assert_array_equal(every.prim, prim[order])
            np.testing.assert_array_equal(every.t, t[order])
            hits = scene.intersect(origins, directions, tmin, tmax)
            np.testing.assert_array_equal(hits.mask, np.diff(every.offsets) > 0)
            np.testing.assert_array_equal(hits.t[hits.mask], every.t[every.offsets[:-1][hits.mask]])
            np.testing.assert_array_equal(scene.occluded(origins, directions, tmin, tmax), hits.mask)
