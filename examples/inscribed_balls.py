"""How thick is a part by the largest ball that touches a triangle from inside?

    python examples/inscribed_balls.py
    python examples/inscribed_balls.py part.stl

Prints the distribution of the balls' diameters and draws inscribed_balls.png. Unlike rays straight through,
balls tell corners from walls. Without a file the part is a vase.
"""

import argparse
from pathlib import Path

import numpy as np
from meshes import scene_of
from pictures import save, surface

import wive


def diameters(scene: wive.Scene, steps: int = 30) -> np.ndarray:
    """(f,) diameters of the largest balls inside a closed mesh that touch the middles of triangles."""
    v0, v1, v2 = scene.vertices.astype(np.float64)[scene.faces].swapaxes(0, 1)
    normals = np.cross(v1 - v0, v2 - v0)
    inwards = -normals / np.linalg.norm(normals, axis=1, keepdims=True)
    start, radius = (v0 + v1 + v2) / 3, np.full(len(v0), np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    for _ in range(steps):  # shrink each ball until nothing of the surface is within it
        touched = scene.closest(start + radius[:, None] * inwards).points() - start
        depth = (touched * inwards).sum(axis=1)
        limit = np.divide((touched**2).sum(axis=1), 2 * depth, out=radius.copy(), where=depth > 1e-6 * radius)
        radius = np.minimum(radius, limit)
    return 2 * radius


def main() -> None:
    """Print and draw the thickness."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path, nargs="?", help="a mesh file; default: a vase")
    scene = scene_of(parser.parse_args().mesh)
    found = diameters(scene)
    low, middle, high = np.nanpercentile(found, (0, 50, 100))
    print(f"diameters of inscribed balls: least {low:.4g}, median {middle:.4g}, greatest {high:.4g}")
    save(surface(scene, found, *np.nanpercentile(found, (5, 95)), "ball", "viridis"), __file__)


if __name__ == "__main__":
    main()
