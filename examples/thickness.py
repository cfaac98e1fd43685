"""How thick is a part under each of its triangles? Where is it too thin?

    python examples/thickness.py
    python examples/thickness.py part.stl --thinnest 0.8

Prints the distribution of the thickness and how much of the surface lies above less than `--thinnest`, and
draws thickness.png. Without a file the part is a vase.
"""

import argparse
from pathlib import Path

import numpy as np
from meshes import scene_of
from pictures import save, surface

import wive


def thickness(scene: wive.Scene) -> tuple[np.ndarray, np.ndarray]:
    """(f,) how far it is from the middle of each triangle straight inwards to the other side, and (f,) areas.

    inf if there is no other side, NaN for triangles without area.
    """
    corners = scene.vertices[scene.faces].astype(np.float64)
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(outwards, axis=1, keepdims=True)
    inwards = -outwards / np.where(length > 0, length, 1)
    origins = scene.spawn(np.arange(len(scene)), (1 / 3, 1 / 3), inwards)  # none hits its own triangle
    found = scene.intersect(origins, inwards).t
    return np.where(length[:, 0] > 0, found, np.nan), length[:, 0] / 2


def main() -> None:
    """Print and draw the thickness."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path, nargs="?", help="a mesh file; default: a vase")
    parser.add_argument("--thinnest", type=float, default=0.1, help="what is allowed, in the file's unit")
    arguments = parser.parse_args()
    found, areas = thickness(scene := scene_of(arguments.mesh))
    known = np.isfinite(found)
    if not known.any():
        parser.exit(1, "no triangle has another side: is the mesh closed, with normals outwards?\n")
    low, middle, high = np.percentile(found[known], (0, 50, 100))
    print(f"thickness: least {low:.4g}, median {middle:.4g}, greatest {high:.4g}")
    thin = areas[known & (found < arguments.thinnest)].sum() / areas.sum()
    print(f"thinner than {arguments.thinnest:g}: {thin:.1%} of the surface")
    save(surface(scene, found, *np.percentile(found[known], (5, 95)), "wall", "viridis"), __file__)


if __name__ == "__main__":
    main()
