"""Pictures of a calibrated camera: depth along its axis, normals, and the number of the triangle seen.

    python examples/depth_picture.py

Prints the depth picture, the nearer the darker, and shading by a lamp at the camera.
"""

import numpy as np

import wive

SHADES = "@%#*+=-:. "
WIDTH, HEIGHT = 72, 30


def torus(steps: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a torus of radii 1 and 0.4 round the z axis."""
    u, v = np.meshgrid(*2 * [np.arange(steps) * 2 * np.pi / steps], indexing="ij")
    ring = 1 + 0.4 * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], axis=-1).reshape(-1, 3)
    number = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = number, np.roll(number, -1, 0), np.roll(number, -1, 1), np.roll(number, (-1, -1), (0, 1))
    faces = np.stack([np.stack([a, b, d], axis=-1), np.stack([a, d, c], axis=-1)]).reshape(-1, 3)
    return vertices.astype(np.float32), faces


def main() -> None:
    """Take the pictures from 4 units away, looking down at the torus, and print two of them."""
    scene = wive.Scene(*torus())
    pose = np.array([[1, 0, 0, 0], [0, -0.6, 0.8, -3.2], [0, -0.8, -0.6, 2.4], [0, 0, 0, 1]])
    camera = wive.PinholeCamera((80, 40, (WIDTH - 1) / 2, (HEIGHT - 1) / 2), pose)  # fx, fy, cx, cy
    hits = scene.intersect(*camera.rays(WIDTH, HEIGHT))
    depth = hits.t  # (30,72), along the camera's axis; inf on a miss
    normals = hits.normals()  # (30,72,3), NaN on a miss
    in_camera = normals @ pose[:3, :3]  # the same in the camera's axes
    triangles = hits.prim  # (30,72), -1 on a miss
    lit = np.nan_to_num(hits.cosines())  # (30,72), 0 on a miss

    for picture in (np.interp(depth, (2.5, 5), (0, 1)), 1 - lit):
        print("\n".join("".join(SHADES[int(9 * value)] for value in row) for row in picture))
    print(f"{len(np.unique(triangles)) - 1} triangles seen, the nearest {depth.min():.2f} away;")
    print(f"normals point towards the camera by {-np.nanmean(in_camera[..., 2]):.2f} in the mean")


if __name__ == "__main__":
    main()
