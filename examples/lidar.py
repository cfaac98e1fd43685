"""A spinning lidar in a street: range image, intensities and point cloud of one turn.

    python examples/lidar.py

Prints how many of its rays returned and draws lidar.png: the range image, and the points from above.
"""

import numpy as np
from matplotlib.figure import Figure
from meshes import street
from pictures import bare, page, save

import wive

FARTHEST = 60.0  # metres


def turn(
    scene: wive.Scene, place: tuple[float, float, float], beams: int = 64, steps: int = 1200
) -> wive.Hits:
    """The hits (beams, steps) of one turn: 45 degrees from the top beam to the lowest."""
    pose = np.eye(4)
    pose[:3, 3] = place
    lidar = wive.SpinningLidar(elevations=np.linspace(20, -25, beams), azimuths=steps, pose=pose)
    return scene.intersect(*lidar.rays(), tmin=0.5, tmax=FARTHEST)


def draw(hits: wive.Hits, place: tuple[float, float, float]) -> Figure:
    """The range image above, the points below."""
    colors = {"cmap": "turbo_r", "vmin": 0, "vmax": 40}
    figure = page()
    title = "range image: {} beams, {} steps".format(*hits.t.shape)
    image = bare(figure, (0.02, 0.68, 0.96, 0.26), title)
    image.imshow(np.where(hits.mask, hits.t, np.nan), aspect="auto", **colors)
    cloud = bare(figure, (0.02, 0.0, 0.96, 0.62), "the points from above")
    x, y = hits.points()[hits.mask][:, :2].T
    cloud.scatter(x, y, s=0.25, c=hits.t[hits.mask], linewidths=0, **colors)
    cloud.plot(*place[:2], "o", color="black", markersize=5)
    cloud.set_aspect("equal")
    cloud.set_xlim(-44, 44)
    cloud.set_ylim(-20, 20)
    return figure


def main() -> None:
    """Trace one turn of a lidar 1.8 m above the road, print what comes back and draw it."""
    place = 0.0, 1.0, 1.8
    hits = turn(wive.Scene(*street()), place)
    ranges = hits.t  # (64,1200), inf if nothing returns
    intensities = np.nan_to_num(hits.cosines() / ranges**2)
    cloud = hits.points()[hits.mask]  # (returns,3)
    print(f"{len(cloud)} of {ranges.size} rays returned, the nearest from {ranges.min():.2f} m,")
    print(f"the strongest from prim {hits.prim.flat[intensities.argmax()]}")
    save(draw(hits, place), __file__)


if __name__ == "__main__":
    main()
