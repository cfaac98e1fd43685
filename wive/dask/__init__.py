"""Queries of rays in dask arrays: chunk by chunk, on threads, processes or a cluster.

>>> import wive.dask
>>> scene = wive.load("city.wive")
>>> hits = wive.dask.intersect(scene, origins, directions)   # dask arrays (n,3)
>>> hits.t.mean().compute()

docs/dask.md says how to run it on a cluster.
"""

import importlib

try:
    _array = importlib.import_module("dask.array")
except ImportError as error:
    raise ImportError(f"wive.dask needs dask ({error}): pip install 'wive[dask]'") from error
if _array.Array.__module__ != "dask.array.core":
    raise ImportError(
        "wive.dask needs dask's usual arrays, got those of query planning, an experiment of dask: "
        "leave dask's option array.query-planning out"
    )

from wive.dask.all_hits import DaskAllHits
from wive.dask.hits import DaskHits
from wive.dask.pictures import render
from wive.dask.queries import count, intersect, intersect_all, occluded

__all__ = ["DaskAllHits", "DaskHits", "count", "intersect", "intersect_all", "occluded", "render"]
