"""Handles of kernels: looked up by their first query, and the same kernels as those of the name."""

import numpy as np
import pytest
from support.meshes import random_rays, soup

from wive import _cpu

USABLE = [name for name, reason in _cpu.kernels().items() if not reason and "." not in name]


@pytest.mark.parametrize("name", USABLE)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_handle_and_its_name_give_the_same_bits(name: str, dtype: type) -> None:
    vertices, faces = soup(500, seed=1)
    bvh, handle = _cpu.Bvh(vertices.astype(dtype), faces), _cpu.Kernels(name)
    origins, directions = (rows.astype(dtype) for rows in random_rays(300, seed=2, low=0, high=1))
    rays = origins, directions, np.zeros(1, dtype), np.full(1, np.inf, dtype)
    assert handle.name == name
    for query in (bvh.intersect, bvh.occluded, bvh.intersect_all, bvh.count):
        for by_handle, by_name in zip(query(handle, *rays)[:-1], query(name, *rays)[:-1], strict=True):
            np.testing.assert_array_equal(by_handle, by_name)


def test_names_are_looked_up_by_the_first_query() -> None:
    bvh, rows = _cpu.Bvh(*soup(5, seed=3)), np.zeros((1, 3), np.float32)
    unknown = _cpu.Kernels("avx3")
    for kernel in (unknown, unknown, "avx3"):
        with pytest.raises(ValueError, match="unknown kernel 'avx3'"):
            bvh.count(kernel, rows, rows, rows[0, :1], rows[0, :1])
    with pytest.raises((TypeError, ValueError), match="kernel"):
        bvh.count(None, rows, rows, rows[0, :1], rows[0, :1])
