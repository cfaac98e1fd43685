"""Ambient occlusion: how much of the sky does each triangle see?

    python examples/openness.py
    python examples/openness.py part.stl --rays 64

Draws openness.png and writes the openness of the triangles, (f,) from 0 to 1, as openness.npy. Without a file
the part is a vase.
"""

import argparse
from pathlib import Path

import numpy as np
from meshes import scene_of
from pictures import save, surface

import wive


def openness(scene: wive.Scene, rays: int = 64, reach: float = np.inf) -> np.ndarray:
    """(f,) the share of cosine-distributed rays from each triangle that hit nothing in reach."""
    corners = scene.vertices[scene.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    random, free = np.random.default_rng(1), np.zeros(len(scene))
    for _ in range(rays):
        ball = random.standard_normal(normals.shape)
        directions = normals + ball / np.linalg.norm(ball, axis=1, keepdims=True)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        origins = scene.spawn(np.arange(len(scene)), (1 / 3, 1 / 3), directions)
        free += ~scene.occluded(origins, directions, tmax=reach)
    return free / rays


def main() -> None:
    """Write and draw the openness."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path, nargs="?", help="a mesh file; default: a vase")
    parser.add_argument("--rays", type=int, default=64, help="rays per triangle")
    parser.add_argument("--reach", type=float, default=np.inf, help="what is farther away does not count")
    arguments = parser.parse_args()
    scene = scene_of(arguments.mesh)
    found = openness(scene, arguments.rays, arguments.reach)
    np.save("openness.npy", found)
    print(f"{len(found)} triangles, openness {found.mean():.3f} on average")
    save(surface(scene, found, 0, 1, "open", "gray"), __file__)


if __name__ == "__main__":
    main()
