"""Indexed arrays of Warp, which choose rows of another array, are rays like any other."""

import numpy as np
import pytest
from support.meshes import random_rays, soup

import wive

wp = pytest.importorskip("warp")

MESH = soup(300, seed=1)


@pytest.mark.parametrize("backend", ["scalar", "warp"])
def test_indexed_arrays_of_warp_are_the_rows_that_they_choose(backend):
    options = {"device": "cpu"} if backend == "warp" else {"backend": backend}
    scene = wive.Scene(*MESH, **options)
    rows = np.int32([3, 1, 4, 1, 5])
    rays = random_rays(8, seed=3)
    chosen = [
        wp.indexedarray(wp.array(ray, dtype=wp.vec3, device="cpu"), [wp.array(rows, device="cpu")])
        for ray in rays
    ]
    plain = [wp.array(ray[rows], dtype=wp.vec3, device="cpu") for ray in rays]
    for query in ("intersect", "intersect_all"):
        found, expected = (getattr(scene, query)(*given) for given in (chosen, plain))
        for name in ("t", "prim", "uv"):
            np.testing.assert_array_equal(getattr(found, name).numpy(), getattr(expected, name).numpy())
    for query in ("occluded", "count"):
        found, expected = (getattr(scene, query)(*given).numpy() for given in (chosen, plain))
        np.testing.assert_array_equal(found, expected)
    hits = scene.intersect(*plain)
    origins, expected = hits.spawn(chosen[1]).numpy(), hits.spawn(plain[1]).numpy()
    np.testing.assert_array_equal(origins, expected)
