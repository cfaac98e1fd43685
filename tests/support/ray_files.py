"""A small scene, rays, and files of these rays in every form that `wive.stream` reads."""

from pathlib import Path

import numpy as np

import wive
from support.meshes import random_rays, soup

COUNT = 1003


def small_scene() -> wive.Scene:
    return wive.Scene(*soup(200, seed=1))


def some_rays(count: int = COUNT) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Origins, directions, tmin and tmax; every limit takes hits away from some rays."""
    origins, directions = random_rays(count, seed=2, low=-0.5, high=1.5)
    random = np.random.default_rng(3)
    limits = random.uniform(0, 0.2, count), random.uniform(0.5, 3, count)
    return origins, directions, *(limit.astype(np.float32) for limit in limits)


def write_rays(form: str, folder: Path, rays: tuple[np.ndarray, ...]) -> tuple[Path, dict[str, object]]:
    """The name of a file of these rays, and the options that read it; `form` is one of FORMS."""
    origins, directions, tmin, tmax = rays
    table = np.column_stack(rays)
    arrays = {"origins": origins, "directions": directions, "tmin": tmin, "tmax": tmax}
    raw, options = folder / "rays.raw", {}
    npz = folder / "rays.npz"
    if form in TABLES:
        np.save(folder / "rays.npy", TABLES[form](table))
        return folder / "rays.npy", options
    if form == "npz":
        np.savez(npz, **arrays)
    elif form == "deflated":
        np.savez_compressed(npz, **arrays)
    elif form == "npz by column":
        np.savez_compressed(npz, **{**arrays, "origins": np.asfortranarray(origins)})
    elif form == "raw":
        mixed = np.column_stack([tmin, origins, np.full(len(tmin), np.nan), tmax, directions])
        mixed.astype(">f8").tofile(raw)
        return raw, {"raw": ">f8", "columns": "tmin,ox,oy,oz,_,tmax,dx,dy,dz"}
    return npz, options


TABLES = {
    "npy": lambda table: table,
    "npy by column": np.asfortranarray,
    "npy of big-endian numbers": lambda table: table.astype(">f4"),
    "npy of float64": lambda table: table.astype(np.float64),
}
FORMS = [*TABLES, "npz", "deflated", "npz by column", "raw"]


def content_of(output: Path) -> dict[str, bytes]:
    """The bytes of an output, by the names of its files."""
    if output.is_file():
        return {"": output.read_bytes()}
    return {path.name: path.read_bytes() for path in sorted(output.iterdir())}


def arrays_of(output: Path) -> dict[str, np.ndarray]:
    """The arrays of an npz file or of a folder of npy files."""
    if output.is_file():
        with np.load(output) as loaded:
            return dict(loaded)
    return {path.stem: np.load(path) for path in sorted(output.glob("*.npy"))}
