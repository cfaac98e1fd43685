"""Pictures of a calibrated camera: depth along its axis, normals, and the number of the triangle seen.

    python examples/depth_picture.py

Prints what is seen and draws depth_picture.png.
"""

import numpy as np
from matplotlib.figure import Figure
from pictures import bare, page, save

import wive

WIDTH, HEIGHT = 640, 480
POSE = np.array([[1, 0, 0, 0], [0, -0.6, 0.8, -3.2], [0, -0.8, -0.6, 2.4], [0, 0, 0, 1]])


def torus(steps: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a torus of radii 1 and 0.4 round the z axis."""
    u, v = np.meshgrid(*2 * [np.arange(steps) * 2 * np.pi / steps], indexing="ij")
    ring = 1 + 0.4 * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], axis=-1).reshape(-1, 3)
    number = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = number, np.roll(number, -1, 0), np.roll(number, -1, 1), np.roll(number, (-1, -1), (0, 1))
    faces = np.stack([np.stack([a, b, d], axis=-1), np.stack([a, d, c], axis=-1)]).reshape(-1, 3)
    return vertices.astype(np.float32), faces


def draw(hits: wive.Hits) -> Figure:
    """Depth, normals and triangles side by side, cut to what is seen."""
    seen = hits.mask
    rows, columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
    part = np.s_[rows[0] - 10 : rows[-1] + 10, columns[0] - 10 : columns[-1] + 10]
    depth = np.where(seen, hits.t, np.nan)
    normals = np.nan_to_num((hits.normals() + 1) / 2, nan=1.0)
    triangles = np.where(seen, hits.prim % 20, np.nan)
    figure = page((6.4, 1.7))
    pictures = (depth, "viridis_r", "depth"), (normals, None, "normals"), (triangles, "tab20", "triangles")
    for i, (picture, colors, title) in enumerate(pictures):
        bare(figure, (0.01 + i * 0.333, 0.01, 0.315, 0.86), title).imshow(picture[part], cmap=colors)
    return figure


def main() -> None:
    """Take the pictures from 4 units away, looking down at the torus."""
    scene = wive.Scene(*torus())
    camera = wive.PinholeCamera((700, 700, (WIDTH - 1) / 2, (HEIGHT - 1) / 2), POSE)  # fx, fy, cx, cy
    hits = scene.intersect(*camera.rays(WIDTH, HEIGHT))
    depth = hits.t  # (480,640), along the camera's axis; inf on a miss
    in_camera = hits.normals() @ POSE[:3, :3]  # (480,640,3) in the camera's axes, NaN on a miss
    triangles = hits.prim  # (480,640), -1 on a miss
    print(f"{len(np.unique(triangles)) - 1} triangles seen, the nearest {depth.min():.2f} away;")
    print(f"normals point towards the camera by {-np.nanmean(in_camera[..., 2]):.2f} in the mean")
    save(draw(hits), __file__)


if __name__ == "__main__":
    main()
