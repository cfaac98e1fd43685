"""The mean colour of a texture over each triangle.

Each triangle is cut into equal ones, about as large as a texel, and each of these has the colour of the
texel at its centre. A triangle within one texel has exactly its colour; nothing beside a triangle is mixed
in, as the levels of a pyramid would do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.colours import Colours, linear
from wive._internal.formats.colours.texture import Texels

# How coordinates beyond the texture are brought into it.
REPEAT, MIRROR, CLAMP = "repeat", "mirror", "clamp"
SIDE = 1  # texels of the longest side of a part, at most
MOST_PARTS = 64  # of a side
MOST_SAMPLES = 1 << 25  # of all triangles of a file, which take seconds; of each at least one
BATCH = 1 << 15  # samples looked at together: they stay in the cache
LINEAR = linear(np.arange(256), 255)


class Means:
    """The means over triangles of all textures of a file."""

    def __init__(self) -> None:
        """Begin with all samples left."""
        self._left = MOST_SAMPLES

    def over(
        self, texels: Texels, places: NDArray[np.float64], wrap: tuple[str, str] = (REPEAT, REPEAT)
    ) -> Colours:
        """Linear colours (f,3) over triangles of these coordinates (f,3,2), NaN if they aren't finite.

        Coordinates are from 0 to 1 in the texture, from its left and from its top.
        """
        with np.errstate(all="ignore"):
            corners = places * texels.shape[1::-1]
            longest = np.hypot(*np.moveaxis(corners - np.roll(corners, 1, axis=1), 2, 0)).max(axis=1)
            colours = np.full((len(places), 3), np.nan)
            parts = np.where(np.isfinite(longest), self._parts(longest), 0)
            listed = texels.reshape(-1, 3)
            for count in np.unique(parts[parts > 0]).tolist():
                weights = _centres(count)
                some = max(1, BATCH // len(weights[0]))
                rows = np.flatnonzero(parts == count)
                for which in (rows[at : at + some] for at in range(0, len(rows), some)):
                    found = np.take(listed, _texels(places[which], weights, texels.shape, wrap), axis=0)
                    for channel in range(3):  # means along the last axis are faster
                        colours[which, channel] = np.take(LINEAR, found[..., channel]).mean(axis=1)
        return colours

    def _parts(self, longest: NDArray[np.float64]) -> NDArray[np.int64]:
        """Into how many parts sides are cut, powers of two, by the longest sides of triangles in texels."""
        wanted = np.clip(np.nan_to_num(longest, posinf=0) / SIDE, 1, MOST_PARTS)
        parts = (2 ** np.ceil(np.log2(wanted))).astype(np.int64)
        most = MOST_PARTS
        while most > 1 and (parts**2).sum() > self._left:
            most //= 2
            parts = np.minimum(parts, most)
        self._left -= int((parts**2).sum())
        return parts


def _centres(parts: int) -> NDArray[np.float64]:
    """Weights (2,parts**2) of the sides at a triangle's first corner, of the centres of its equal parts."""
    grid = np.stack(np.divmod(np.arange(parts * parts), parts))
    upright, turned = grid[:, grid.sum(axis=0) < parts], grid[:, grid.sum(axis=0) < parts - 1]
    return np.concatenate([upright + 1 / 3, turned + 2 / 3], axis=1) / parts


def _texels(
    places: NDArray[np.float64], weights: NDArray[np.float64], shape: tuple[int, ...], wrap: tuple[str, str]
) -> NDArray[np.int64]:
    """Which texels (f,n) of a texture of this shape are at n places of each triangle."""
    first, u, v = places[:, :1], places[:, 1:2] - places[:, :1], places[:, 2:] - places[:, :1]
    column, row = (
        _inside(first[..., axis] + weights[0] * u[..., axis] + weights[1] * v[..., axis], size, wrap[axis])
        for axis, size in ((0, shape[1]), (1, shape[0]))
    )
    return row * shape[1] + column


def _inside(place: NDArray[np.float64], size: int, wrap: str) -> NDArray[np.int64]:
    """The texels, from 0 to size - 1, that places are on."""
    if wrap == MIRROR:
        place = 1 - np.abs(place - 2 * np.floor(place / 2) - 1)
    elif wrap == REPEAT:
        place = place - np.floor(place)
    return np.clip(place * size, 0, size - 1).astype(np.int64)
