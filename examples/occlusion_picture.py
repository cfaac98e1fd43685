"""Ambient occlusion of what a camera sees, by your own rays.

    python examples/occlusion_picture.py mesh.ply

Writes mesh.occlusion.npy, a picture (270,480), and prints it. `wive.render(scene, shading="ao")` does the
same with colours, smooth edges and a reach that suits rooms.
"""

import sys
from pathlib import Path

import numpy as np

import wive

SHADES = "@%#*+=-:. "


def occlusion(scene: wive.Scene, camera: wive.Camera, width: int = 480, height: int = 270, rays: int = 32):
    """(h,w), the share of cosine-distributed rays from each pixel's surface that leave the scene."""
    random = np.random.default_rng(0)
    hits = scene.intersect(*camera.rays(width, height))
    facing = np.where(hits.front[..., None], hits.normals(), -hits.normals())  # the side that is seen
    free = np.zeros((height, width))
    for _ in range(rays):
        sphere = random.standard_normal((height, width, 3))
        outward = facing + sphere / np.linalg.norm(sphere, axis=-1, keepdims=True)
        free += ~scene.occluded(hits.spawn(outward), outward)
    return free / rays


def main() -> None:
    """Take the picture from where most of the mesh is seen."""
    path = Path(sys.argv[1])
    scene = wive.Scene.from_file(path)
    picture = occlusion(scene, wive.Camera.showing(scene))
    np.save(path.with_suffix(".occlusion.npy"), picture.astype(np.float32))
    for row in picture[::9, ::5]:
        print("".join(SHADES[int(9 * value)] for value in row))


if __name__ == "__main__":
    main()
