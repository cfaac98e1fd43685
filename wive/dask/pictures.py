"""Pictures in tiles of rows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import dask.array as da
import numpy as np
from dask.base import tokenize
from dask.delayed import delayed
from numpy.typing import NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.picture import Colours, How, Image, Shading
from wive.dask.carried import CarriedScene, carried
from wive.rendering import (
    EXPOSABLE,
    Perspective,
    Plan,
    expose,
    exposure_factor,
    planned,
    render_rows,
    settings_of,
)
from wive.scene import Scene

if TYPE_CHECKING:
    from typing_extensions import Unpack

# Samples per tile, if its rows are not given: about a second on one core.
TILE_SAMPLES = 1 << 20


def render(
    scene: Scene,
    camera: Perspective | None = None,
    *,
    rows: int | None = None,
    shading: Shading = "auto",
    width: int = 1280,
    height: int = 720,
    spp: int = 32,
    albedo: Colours = None,
    seed: int = 0,
    threads: int | None = None,
    **how: Unpack[How],
) -> da.Array:
    """The picture of `wive.render`, bit for bit, as a dask array in tiles of whole rows.

    Arguments are those of `wive.render`, and:
        rows: of each tile but the last; None is so many that a tile has about a million samples.
        threads: per tile; None is one, because dask renders as many tiles at a time as its workers have
            threads. For CPU backends.

    The camera, and what "auto" means for it, are decided here, which traces some thousand rays, on as many
    threads as `threads` allows. `exposure="auto"` collects the picture's green channel on one worker.

    Returns (height, width, 3) float32, or (height, width) if the shading is "depth". Raises ValueError or
    TypeError that names a bad argument.

    >>> wive.write_picture("city.png", wive.dask.render(scene, camera, width=16_000, height=9_000).compute())
    """
    held, once = carried(scene)
    settings = settings_of(
        shading=shading, width=width, height=height, spp=spp, albedo=albedo, seed=seed, threads=threads, **how
    )
    if rows is None:
        rows = max(1, TILE_SAMPLES // (width * spp))
    rows = min(arguments.integer("rows", rows, 1), height)
    with _cpu.DefaultFloats():
        plan = planned(held.scene, camera, settings)
    if threads is None and "threads" not in held.scene._tracer.lacks:
        threads = 1
    plan = plan._replace(settings=replace(settings, albedo=None, threads=threads))
    numbers = da.from_array(np.arange(height), chunks=rows)
    axes = tuple(range(len(plan.shape)))
    form = {
        "new_axes": dict(zip(axes[1:], plan.shape[1:], strict=True)),
        "dtype": np.float32,
        "meta": np.empty((0,) * len(axes), np.float32),
    }
    plan_once = delayed(plan, name=f"wive-picture-{tokenize(plan)}", pure=True, traverse=False)
    picture = da.blockwise(
        _tile, axes, once, None, plan_once, None, numbers, (0,), token="wive-render", **form
    )
    if plan.shading not in EXPOSABLE or settings.exposure == 0:
        return picture
    if settings.exposure == "auto":
        factor = delayed(exposure_factor, pure=True)(picture[:, :, 1], "auto")
    else:
        factor = exposure_factor(None, settings.exposure)
    return da.blockwise(_exposed, axes, picture, axes, factor, None, dtype=np.float32, meta=picture._meta)


def _tile(carried: CarriedScene, plan: Plan, rows: NDArray[np.int64]) -> Image:
    begin, end = int(rows[0]), int(rows[-1]) + 1
    image: Image = np.zeros(plan.shape, np.float32)  # of which only these rows take memory
    with _cpu.DefaultFloats():
        render_rows(carried.scene, plan, image, begin, end)
    return image[begin:end].copy()


def _exposed(tile: Image, factor: np.float32) -> Image:
    return expose(tile.copy(), factor)
