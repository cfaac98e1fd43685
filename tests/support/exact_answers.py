"""Exact arithmetic's results on the hard sets, and the rays whose results differ from them."""

import functools

import numpy as np

from support.hard_sets import hard_set
from support.oracle import Truth, truth

ZERO, INFINITE = np.zeros(1, np.float32), np.full(1, np.inf, np.float32)


@functools.cache
def truth_of(name: str) -> Truth:
    return truth(*hard_set(name), ZERO, INFINITE)


def wrong_rays(found: Truth, right: Truth) -> np.ndarray:
    """The rays whose results are not the right bits; any NaN equals any other."""
    uv = (found.uv.view(np.uint32) == right.uv.view(np.uint32)) | (np.isnan(found.uv) & np.isnan(right.uv))
    same = (found.t.view(np.uint32) == right.t.view(np.uint32)) & (found.prim == right.prim) & uv.all(axis=1)
    return np.flatnonzero(~(same & (found.occluded == right.occluded)))
