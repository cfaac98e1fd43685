"""Rays of a file, to a file: more than fit into memory, and where a run was interrupted it goes on.

    python examples/rays_of_files.py

Writes rays.npy and hits.npz and draws rays_of_files.png: where rays from a lamp end in a street.
"""

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from meshes import street
from pictures import bare, page, save

import wive

RAYS, PIECE = 2_000_000, 250_000
LAMP = 0.0, 0.0, 5.0


def write_rays(path: str) -> None:
    """Rays (n,6) from the lamp in all directions, written piece by piece."""
    rays = np.lib.format.open_memmap(path, "w+", np.float32, (RAYS, 6))
    random = np.random.default_rng(1)
    for first in range(0, RAYS, PIECE):
        rays[first : first + PIECE, :3] = LAMP
        rays[first : first + PIECE, 3:] = random.standard_normal((PIECE, 3))
    rays.flush()


def light(scene: wive.Scene, path: str, edges: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(columns, rows) how many rays end in each cell, seen from above; pieces are traced in turn."""
    found = np.zeros((len(edges[0]) - 1, len(edges[1]) - 1))
    for _, hits in wive.stream(scene, path):
        x, y, _ = hits.points()[hits.mask].T
        found += np.histogram2d(x, y, edges)[0]
    return found


def draw(found: np.ndarray) -> Figure:
    """The street from above."""
    figure = page((6.4, 2.6))
    title = f"{RAYS:,} rays from a street lamp, read and traced in pieces"
    axes = bare(figure, (0.02, 0.02, 0.96, 0.86), title)
    seen = np.where(found > 0, found, np.nan).T
    axes.imshow(seen, cmap="magma_r", origin="lower", aspect="auto", norm=LogNorm(0.3, found.max()))
    return figure


def main() -> None:
    """Write rays, trace them to a file, and draw where they end."""
    scene = wive.Scene(*street())
    write_rays("rays.npy")
    wive.trace(scene, "rays.npy", "hits.npz")  # resume=True goes on with a run that was interrupted
    print(f"{np.isfinite(np.load('hits.npz')['t']).mean():.0%} of the rays hit the street")
    save(draw(light(scene, "rays.npy", (np.linspace(-45, 45, 451), np.linspace(-16, 16, 161)))), __file__)


if __name__ == "__main__":
    main()
