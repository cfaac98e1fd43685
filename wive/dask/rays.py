"""Rays in chunks: dask arrays, and what NumPy has beside them, as `dask.array.blockwise` takes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import dask.array as da
import numpy as np
from numpy.typing import ArrayLike

from wive._internal import arguments
from wive._internal.rays import NAMES

# A dask array, or what NumPy makes an array of.
Given = da.Array | ArrayLike
Shape = tuple[float, ...]  # NaN is an axis of unknown length

# The label of the axis of a vector's numbers; leading axes are numbered.
VECTOR = -1


class ChunkedRays(NamedTuple):
    """Origins, directions, tmin and tmax, each with the labels of its axes; None for what all rays share."""

    pairs: tuple[tuple[Any, tuple[int, ...] | None], ...]
    leading: Shape
    meta: Any  # an empty array of the library that results are of

    @property
    def labels(self) -> tuple[int, ...]:
        """Those of the leading axes."""
        return tuple(range(len(self.leading)))

    @property
    def flat(self) -> list[Any]:
        """The pairs one after another."""
        return [part for pair in self.pairs for part in pair]


def chunked_rays(origins: Given, directions: Given, tmin: Given, tmax: Given) -> ChunkedRays:
    """The rays, checked as far as it can be without their numbers."""
    vectors = [as_vectors(name, value) for name, value in zip(NAMES, (origins, directions), strict=False)]
    if not any(isinstance(value, da.Array) for value in vectors):
        raise TypeError(
            f"origins or directions must be a dask array, got {type(origins).__name__} and "
            f"{type(directions).__name__}: query the scene itself, or use dask.array.from_array"
        )
    if vectors[0].ndim == vectors[1].ndim == 1:
        vectors = [value[None] for value in vectors]
    one, other = (value.shape for value in vectors)
    if (3,) not in (one, other) and not same_shape(one, other):
        raise ValueError(
            "origins and directions must have one shape, or one of them (3,) if all rays share it, "
            f"got {one} and {other}"
        )
    leading = max(one, other, key=len)[:-1]
    lazy = sorted((value for value in vectors if isinstance(value, da.Array)), key=lambda value: -value.ndim)
    chunks = lazy[0].chunks[:-1] or ("auto",) * len(leading)
    pairs = [labelled(name, value, leading, chunks) for name, value in zip(NAMES, vectors, strict=False)]
    for name, value in zip(NAMES[2:], (tmin, tmax), strict=True):
        limit = _as_array(name, value, "a real number or one per ray")
        if limit.shape != () and not same_shape(limit.shape, leading):
            raise ValueError(
                f"{name} must be one number or have shape {leading}, one per ray, got shape {limit.shape}"
            )
        pairs.append(labelled(name, limit, leading, chunks, tail=()))
    _expect_aligned(pairs)
    return ChunkedRays(tuple(pairs), leading, lazy[0]._meta)


def as_vectors(name: str, value: Given) -> Any:
    """A dask array whose last axis is in one piece, or NumPy's; of shape (..., 3)."""
    array = _as_array(name, value, "an (n, 3) array of real numbers")
    if array.shape[-1:] != (3,):
        raise ValueError(f"{name} must have shape (..., 3), one vector per ray, got {array.shape}")
    if isinstance(array, da.Array) and array.numblocks[-1] > 1:
        array = array.rechunk({-1: 3})
    return array


def labelled(
    name: str,
    array: Any,
    leading: Shape,
    chunks: Sequence[Any],
    tail: tuple[int, ...] = (VECTOR,),
) -> tuple[Any, tuple[int, ...] | None]:
    """The array with the labels of its axes; NumPy's in the chunks of the others, or whole if shared."""
    if array.ndim == len(tail):
        return array, tail if isinstance(array, da.Array) else None
    if not isinstance(array, da.Array):
        if any(map(math.isnan, leading)):
            raise ValueError(
                f"{name} must be a dask array, as the rays are in chunks of unknown sizes, got one of NumPy: "
                "call compute_chunk_sizes() on the rays"
            )
        array = da.from_array(array, chunks=(*chunks, *((3,) for _ in tail)))
    return array, (*range(len(leading)), *tail)


def _expect_aligned(pairs: Sequence[tuple[Any, tuple[int, ...] | None]]) -> None:
    """Raise ValueError for chunks that dask can't align, as their sizes are unknown."""
    (first, chunks), *others = [
        (name, str(array.chunks[: len(labels) - (VECTOR in labels)]))
        for name, (array, labels) in zip(NAMES, pairs, strict=True)
        if labels and labels != (VECTOR,)
    ]
    for name, found in others:
        if found != chunks and "nan" in found + chunks:
            raise ValueError(
                f"{first} and {name} must be in the same chunks, as some are of unknown sizes, got {chunks} "
                f"and {found}: call compute_chunk_sizes() on both"
            )


def same_shape(one: Shape, other: Shape) -> bool:
    """Whether shapes agree in all lengths that are known."""
    return len(one) == len(other) and all(
        a == b or math.isnan(a) or math.isnan(b) for a, b in zip(one, other, strict=True)
    )


def _as_array(name: str, value: Given, expected: str) -> Any:
    if not isinstance(value, da.Array):
        return arguments.array_of_numbers(name, value)
    if value.dtype is not None and value.dtype.kind not in "fiu":
        raise TypeError(f"{name} must be {expected}, got dtype {value.dtype}: convert it first")
    return value


def whole(block: Any) -> Any:
    """The block of an axis that is in one piece, which blockwise passes in lists."""
    while isinstance(block, list):
        (block,) = block
    return block


def empty_like(meta: Any, dtype: Any, ndim: int) -> Any:
    """The `meta` of results: of NumPy for masked arrays, else of the library of the rays."""
    if isinstance(meta, np.ndarray):
        return np.empty((0,) * ndim, dtype)
    return da.utils.meta_from_array(meta, ndim=ndim, dtype=np.dtype(dtype))
