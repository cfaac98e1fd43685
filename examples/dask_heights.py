"""A map of heights by rays from above, in chunks that dask traces on threads, processes or a cluster.

    python examples/dask_heights.py

Prints the heights and draws dask_heights.png: a finer grid than that of the land. Needs dask.
"""

import dask
import dask.array as da
import numpy as np
from matplotlib.figure import Figure
from meshes import land
from pictures import bar, bare, page, relief, save

import wive
import wive.dask

ROWS, COLUMNS, CHUNK = 960, 1200, 240  # CHUNK rows at a time


def heights(scene: wive.Scene) -> da.Array:
    """(ROWS,COLUMNS) heights by rays straight down, north up; nothing is traced before it is computed."""
    (west, south, _), (east, north, top) = scene.bounds
    x = da.linspace(west, east, COLUMNS, chunks=COLUMNS)
    y = da.linspace(north, south, ROWS, chunks=CHUNK)
    flat = da.stack(da.broadcast_arrays(x[None], y[:, None], top + 1), axis=-1)
    hits = wive.dask.intersect(scene, flat.rechunk((CHUNK, COLUMNS, 3)), (0.0, 0.0, -1.0))
    return top + 1 - hits.t


def draw(z: np.ndarray) -> Figure:
    """The land in colours of its height."""
    low, high = np.nanpercentile(z, (1, 99))
    figure = page()
    axes = bare(figure, (0.01, 0.01, 0.84, 0.98))
    axes.imshow(relief(np.nan_to_num(z, nan=low)[::2, ::2]), cmap="gray", vmin=0, vmax=1, aspect="auto")
    axes.imshow(z[::2, ::2], cmap="terrain", vmin=low - 200, vmax=high, alpha=0.55, aspect="auto")
    bar(figure, "metres", low, high, "terrain")
    return figure


def main() -> None:
    """Compute the map on this machine's threads; with a distributed.Client, on its workers."""
    scene = wive.Scene.from_heightfield(*land())
    (z,) = dask.compute(heights(scene))
    z = np.where(np.isfinite(z), z, np.nan)
    print(f"{z.size} rays in {ROWS // CHUNK} chunks: heights from {np.nanmin(z):.0f} to {np.nanmax(z):.0f} m")
    save(draw(z), __file__)


if __name__ == "__main__":
    main()
