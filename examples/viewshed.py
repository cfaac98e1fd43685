"""Line of sight on real terrain: which land does a lookout see, the horizon there, and how much sky.

    python examples/viewshed.py

Prints a map: the land that is seen from the highest place is dark. Needs matplotlib, which brings elevations.
"""

import numpy as np

import wive

METRES_PER_DEGREE = 111_320.0


def sees(scene: wive.Scene, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...,) whether nothing lies between places a and b (...,3) in the air; either may be (3,)."""
    return ~scene.occluded(a, np.subtract(b, a), tmax=1.0)


def viewshed(scene: wive.Scene, eye: np.ndarray, shape: tuple[int, int], above: float) -> np.ndarray:
    """(rows, columns) whether `eye` (3,) sees what stands so high above each height of the grid."""
    heads = scene.vertices.reshape(*shape, 3) + np.array([0, 0, above])
    return sees(scene, eye, heads) & np.isfinite(heads[..., 2])


def horizon(scene: wive.Scene, places: np.ndarray, azimuths: np.ndarray) -> np.ndarray:
    """(..., azimuths) elevations in degrees above which places (...,3) see the sky, by bisection.

    Azimuths are in degrees from north over east. Terrain has no overhangs: below what is blocked, all is.
    """
    turn = np.radians(azimuths)
    low = np.full((*places.shape[:-1], len(turn)), -90.0)
    high = -low
    origins = np.broadcast_to(places[..., None, :], (*low.shape, 3))
    for _ in range(30):
        middle = np.radians(low + high) / 2
        flat = np.cos(middle)
        d = np.stack([flat * np.sin(turn), flat * np.cos(turn), np.sin(middle)], axis=-1)
        blocked = scene.occluded(origins, d)
        low, high = np.where(blocked, (low + high) / 2, low), np.where(blocked, high, (low + high) / 2)
    return high


def sky_view(horizons: np.ndarray) -> np.ndarray:
    """(...,) the fraction of the sky's light that level ground receives, by its horizons (..., azimuths)."""
    return np.mean(np.cos(np.radians(np.clip(horizons, 0, 90))) ** 2, axis=-1)


def main() -> None:
    """Print the land that the highest place of the Jacksboro fault in Tennessee sees."""
    from matplotlib import cbook

    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as sample:
        z = sample["elevation"].astype(np.float64)
        x = np.arange(z.shape[1]) * float(sample["dx"]) * METRES_PER_DEGREE * np.cos(np.radians(36.6))
        y = np.arange(z.shape[0]) * -float(sample["dy"]) * METRES_PER_DEGREE  # from north to south
    scene = wive.Scene.from_heightfield(z, x, y)
    top = np.argmax(z)
    eye = scene.vertices[top] + [0, 0, 10]  # on a tower of 10 m
    seen = viewshed(scene, eye, z.shape, above=1.8)
    valley = scene.vertices[np.argmin(z)] + [0, 0, 1.8]
    horizons = horizon(scene, valley, np.arange(0, 360, 5))

    for row, column in np.ndindex(43, 80):
        place = row * 8, column * 5
        is_top = place == (top // z.shape[1] // 8 * 8, top % z.shape[1] // 5 * 5)
        print("^" if is_top else "#" if seen[place] else ".", end="\n" if column == 79 else "")
    print(f"{100 * seen.mean():.1f} % of the land is seen from the highest place. At the lowest place the")
    height, sky = horizons.max(), sky_view(horizons)
    print(f"horizon is up to {height:.1f} degrees high, and the sky view factor is {sky:.3f}.")


if __name__ == "__main__":
    main()
