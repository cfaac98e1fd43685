"""Ambient occlusion of what a camera sees, by your own rays.

    python examples/occlusion_picture.py
    python examples/occlusion_picture.py mesh.ply

Draws occlusion_picture.png and writes the numbers (270,480) as occlusion_picture.npy. Without a file the mesh
is a street. `wive.render(scene, shading="ao")` does the same with colours, smooth edges and a reach for
rooms.
"""

import argparse
from pathlib import Path

import numpy as np
from meshes import street
from pictures import bare, page, save

import wive


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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path, nargs="?", help="a mesh file; default: a street")
    path = parser.parse_args().mesh
    scene = wive.Scene(*street()) if path is None else wive.Scene.from_file(path)
    above = wive.Camera(eye=(-48, -22, 30), target=(2, 0, 0), up=(0, 0, 1), fov=32)
    found = occlusion(scene, wive.Camera.showing(scene) if path else above)
    np.save("occlusion_picture.npy", found.astype(np.float32))
    print(f"{found.mean():.0%} of the rays leave the scene")
    figure = page((6.4, 3.6))
    bare(figure).imshow(found, cmap="gray", vmin=0, vmax=1)
    save(figure, __file__)


if __name__ == "__main__":
    main()
