"""WiVe: fast ray queries on triangle meshes.

>>> scene = wive.Scene(vertices, faces)
>>> hits = scene.intersect(origins, directions)   # closest hits: t, prim, uv
>>> shadowed = scene.occluded(origins, directions)
>>> all_hits = scene.intersect_all(origins, directions)   # every hit along every ray

The method is that of Fuetterling, Lojewski, Pfreundt, Hamann and Ebert, "Accelerated Single Ray
Tracing for Wide Vector Units", High-Performance Graphics 2017.
"""

try:
    from wive import _cpu as _cpu
except ImportError as error:
    reason = f"there is none in {__path__[0]}" if error.name == __name__ else error
    raise ImportError(
        f"wive's compiled core can't be loaded ({reason}): "
        "install with `pip install .` and don't import wive from inside its source folder"
    ) from error

import importlib
from typing import TYPE_CHECKING

from wive import embreex, trimesh
from wive._internal.thread_setting import set_by_environment as _set_by_environment
from wive._internal.thread_setting import set_threads
from wive.all_hits import AllHits
from wive.backend import Backend, backends
from wive.camera import Camera
from wive.closest import Closest
from wive.colors import load_colors
from wive.estimating import Estimate, estimate
from wive.geoms import Geoms
from wive.hits import Hits, Stats
from wive.loading import load
from wive.meshfile import load_mesh
from wive.rendering import render, write_picture
from wive.scene import Scene
from wive.sensors import EquirectangularCamera, OrthographicCamera, PinholeCamera, SpinningLidar
from wive.streams import Traced, stream, trace

__version__ = "0.2.0"

__all__ = [
    "AllHits",
    "Backend",
    "Camera",
    "Closest",
    "EquirectangularCamera",
    "Estimate",
    "Geoms",
    "Hits",
    "OrthographicCamera",
    "PinholeCamera",
    "Scene",
    "SpinningLidar",
    "Stats",
    "Traced",
    "backends",
    "embreex",
    "estimate",
    "load",
    "load_colors",
    "load_mesh",
    "render",
    "set_threads",
    "stream",
    "trace",
    "trimesh",
    "write_picture",
]

_set_by_environment()


def __dir__() -> list[str]:
    return __all__


if not TYPE_CHECKING:  # a type checker takes a module with __getattr__ to have every name

    def __getattr__(name: str) -> object:
        """The parts that need another package, when they are first used."""
        if name in {"dask", "torch", "warp_kernels"}:
            return importlib.import_module(f"wive.{name}")
        raise AttributeError(f"module 'wive' has no attribute {name!r}")
