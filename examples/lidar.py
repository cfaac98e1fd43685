"""A spinning lidar in a street: range image, intensities and point cloud of one turn.

    python examples/lidar.py

Prints the range image, the nearer the darker, and how many of its rays returned.
"""

import numpy as np

import wive

SHADES = "@%#*+=-:. "


def street() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a road between two rows of houses."""
    boxes = [((-60, -6, -0.1), (60, 6, 0))]
    for i, x in enumerate(range(-56, 56, 14)):
        boxes += [((x, -16, 0), (x + 10, -7, 6 + i % 3)), ((x + 3, 7, 0), (x + 12, 16, 5 + i % 4))]
    corner = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4)]
    triangles = np.array([f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))])
    vertices = np.concatenate([np.where(corner, high, low) for low, high in boxes])
    faces = np.concatenate([triangles + 8 * i for i in range(len(boxes))])
    return vertices.astype(np.float32), faces


def main() -> None:
    """Trace one turn of a lidar 1.8 m above the road, and print what comes back."""
    scene = wive.Scene(*street())
    pose = np.eye(4)
    pose[:3, 3] = 0, 1, 1.8
    lidar = wive.SpinningLidar(elevations=np.linspace(20, -25, 16), azimuths=96, pose=pose)
    hits = scene.intersect(*lidar.rays(), tmin=0.5, tmax=60)
    ranges = hits.t  # (16,96), inf if nothing returns
    intensities = np.nan_to_num(hits.cosines() / ranges**2)
    cloud = hits.points()[hits.mask]  # (returns,3)

    shade = np.interp(ranges, (0, 40), (0, len(SHADES) - 1)).astype(int)
    print("\n".join("".join(SHADES[s] for s in row) for row in shade))
    print(f"{len(cloud)} of {ranges.size} rays returned, the nearest from {ranges.min():.2f} m,")
    print(f"the strongest from prim {hits.prim.flat[intensities.argmax()]}")


if __name__ == "__main__":
    main()
