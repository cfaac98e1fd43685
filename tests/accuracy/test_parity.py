"""Parity against manifold3d, which casts rays by rules of its own and shares no code with wive.

Its `ray_cast` also keeps parity at vertices and edges, so all kinds of rays are compared. It works in double
and rounds end points, so only parity is compared, not each hit.
"""

from typing import Literal

import numpy as np
import pytest
from support.closed_meshes import TETRAHEDRON, grid, leaving, placed
from support.meshes import sphere
from support.voxels import surface_rays, voxels

import wive

manifold3d = pytest.importorskip("manifold3d", reason="manifold3d casts rays for comparison")
Mesh = tuple[np.ndarray, np.ndarray]
KINDS: list[tuple[Literal["watertight", "exact"], type]] = [
    ("exact", np.float32),
    ("watertight", np.float32),
    ("watertight", np.float64),
]

MESHES = {
    "tetrahedron": TETRAHEDRON,
    "grid": grid(4),
    "sphere": sphere(3),
    "sphere far away": placed(sphere(2), 1000.0, (148376, 1234, -223423)),
}


def manifold_of(mesh: Mesh) -> "manifold3d.Manifold":
    solid = manifold3d.Manifold(manifold3d.Mesh(mesh[0], mesh[1].astype(np.uint32)))
    assert solid.status() == manifold3d.Error.NoError
    assert solid.num_tri() == len(mesh[1])  # as it is, not simplified
    return solid


def parity(
    solid: "manifold3d.Manifold", origins: np.ndarray, directions: np.ndarray, length: float
) -> np.ndarray:
    starts = origins.astype(np.float64)
    ends = starts + length * directions.astype(np.float64)
    return np.array([len(solid.ray_cast(tuple(a), tuple(b))) % 2 for a, b in zip(starts, ends, strict=True)])


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("spread", [0.1, 2.0])
def test_parity_is_that_of_manifold3d_at_vertices_and_edges_and_anywhere(
    usable_backends: list[str], name: str, spread: float
) -> None:
    """`spread`: origins inside the mesh, or around it."""
    random = np.random.default_rng(71)
    mesh = MESHES[name]
    origins, directions = leaving(mesh, 1500, random, spread)
    directions[::3] = random.standard_normal((500, 3)) * np.abs(directions).max()
    right = parity(manifold_of(mesh), origins, directions, 1024.0)
    assert right.mean() == 1 if spread < 1 else right.mean() < 0.3
    check(usable_backends, mesh, origins, directions, right)


def test_parity_is_that_of_manifold3d_between_voxels(usable_backends: list[str]) -> None:
    """Axis rays, diagonals and rays at vertices, from inside and outside of a solid with holes."""
    vertices, faces, _ = voxels(2)  # manifold3d keeps every triangle of this mesh
    origins, directions = surface_rays(vertices, 40, 1500)
    right = parity(manifold_of((vertices, faces)), origins, directions, 64.0)
    assert 0.1 < right.mean() < 0.9
    check(usable_backends, (vertices, faces), origins, directions, right)


def check(
    backends: list[str], mesh: Mesh, origins: np.ndarray, directions: np.ndarray, right: np.ndarray
) -> None:
    for backend in backends:
        if backend == "warp":
            continue  # test_crossings.py and test_exact_crossings.py compare the other backends' counts
        for nodes in ("float32", "compressed"):
            for accuracy, dtype in KINDS:
                scene = wive.Scene(
                    mesh[0].astype(dtype), mesh[1], backend=backend, accuracy=accuracy, nodes=nodes
                )
                counts = scene.count(origins.astype(dtype), directions.astype(dtype))
                np.testing.assert_array_equal(counts % 2, right)
