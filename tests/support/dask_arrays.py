"""Rays in dask arrays, and comparisons of dask arrays with NumPy's; skips without dask."""

import math

import numpy as np
import pytest

import wive
from support.meshes import random_rays, soup

dask = pytest.importorskip("dask")
da = pytest.importorskip("dask.array")

COUNT = 600
ORIGINS, DIRECTIONS = random_rays(COUNT, seed=6)
LIMITS = np.random.default_rng(1).uniform(0, 2, COUNT)


def scene_of(**options) -> wive.Scene:
    return wive.Scene(*soup(400, seed=7, dtype=options.pop("dtype", np.float32)), **options)


def in_chunks(array: np.ndarray, chunks=(100, 3)):
    return da.from_array(array, chunks=chunks)


def same(found, expected: np.ndarray) -> None:
    """A dask array that says before what it is when computed, equal to NumPy's."""
    all_same([(found, expected)])


def all_same(pairs: list[tuple]) -> None:
    """Dask arrays, computed together."""
    all_computed = dask.compute(*(found for found, _ in pairs))
    for (found, expected), computed in zip(pairs, all_computed, strict=True):
        assert isinstance(found, da.Array)
        assert type(computed) is type(found._meta) is np.ndarray
        assert computed.dtype == found.dtype == found._meta.dtype == expected.dtype
        assert computed.ndim == found.ndim == found._meta.ndim
        assert all(a == b or math.isnan(a) for a, b in zip(found.shape, computed.shape, strict=True))
        np.testing.assert_array_equal(computed, expected)


def note_queries(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    """A list that gets the options of each call of a scene's query."""
    calls: list[dict] = []
    for name in ("intersect", "intersect_all", "occluded", "count"):
        query = getattr(wive.Scene, name)

        def call(self, *rays, query=query, **options):
            calls.append(options)
            return query(self, *rays, **options)

        monkeypatch.setattr(wive.Scene, name, call)
    return calls
