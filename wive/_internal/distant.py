"""Rays from far away, brought to the scene in float64 before they are rounded to float32.

Rounding an origin or a direction to float32 moves a ray sideways by up to 1e-7 of the way to the scene: from
1e7 sizes away, by the size of the whole scene.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.precision import EXACT, FLOAT64, Floats, Real
from wive._internal.rays import Rays

# From this many radii away, rounding moves a ray by less than 1e-4 radii. Nearer ones are left as they are.
FAR = 256.0
# NumPy's reductions take longer than Python's of so few rays, and most of the time of a one-ray query.
FEW = 16
# The largest coordinate of an origin that does not miss, docs/accuracy.md.
MOST_COORDINATE = 1e18

Float64 = NDArray[np.float64]
Traced = tuple[Floats, Floats, Floats, Floats]


class Ball(NamedTuple):
    """A ball that contains all triangles, and the coordinates between which no origin is far from it."""

    center: Float64
    radius: float
    lowest: float
    highest: float

    @classmethod
    def around(cls, bounds: Floats) -> Ball:
        """The ball around a box (2,3); if that is empty or infinite, no origin is far."""
        if not np.isfinite(bounds).all():
            return cls(np.zeros(3), 0.0, -np.inf, np.inf)
        low, high = bounds.astype(np.float64)
        center, radius = low + (high - low) / 2, math.hypot(*(high - low)) / 2
        return cls(center, radius, float(center.max()) - FAR * radius, float(center.min()) + FAR * radius)

    def may_have_far(self, origins: Floats) -> bool:
        """Whether some origin (n,3) may be far; two reductions show that none is in most batches."""
        if len(origins) == 0:
            return False
        if len(origins) < FEW:
            numbers = origins.reshape(-1).tolist()
            lowest, highest = min(numbers), max(numbers)
        else:
            lowest, highest = origins.min(), origins.max()
        return not (self.lowest <= lowest and highest <= self.highest)

    def steps(self, origins: Float64, directions: Float64, most: float = MOST_COORDINATE) -> Float64:
        """(n,) how far along each ray, in lengths of its direction, it comes near; 0 if it starts near.

        What the line through the ray meets of the scene lies ahead of that place. Origins with a coordinate
        beyond `most` stay.
        """
        steps = np.zeros(len(origins))
        with np.errstate(over="ignore", invalid="ignore"):
            away = self.center - origins
            distance = np.abs(away).max(axis=1)
            longest = np.abs(directions).max(axis=1)
            is_ray = (np.abs(origins).max(axis=1) <= most) & (longest > 0) & np.isfinite(longest)
            (far,) = np.nonzero((distance > FAR * self.radius) & is_ray)
            along = self._before(origins[far], directions[far] / longest[far, None]) / longest[far]
        steps[far] = np.where(np.isfinite(along), along, 0)
        return steps

    def starts(self, origins: Float64, directions: Float64, steps: Float64) -> Float64:
        """(n,3) where rays are after `steps`.

        `steps` and what is added to an origin are rounded to 1e-16 of the way, so that from 1e16 radii away a
        ray could end up behind the scene: the sum is moved along the ray once more.
        """
        unit = directions / np.abs(directions).max(axis=1)[:, None]
        near = origins + steps[:, None] * directions
        return np.asarray(near + self._before(near, unit)[:, None] * unit)

    def _before(self, origins: Float64, unit: Float64) -> Float64:
        """(n,) how far along each ray it enters a ball of twice the radius, if it aims at the center."""
        squared = np.einsum("ij,ij->i", unit, unit)
        towards = np.einsum("ij,ij->i", self.center - origins, unit)
        return np.asarray(towards / squared - 2 * self.radius / np.sqrt(squared))


class Moved(NamedTuple):
    """Rays of which some start nearer than they were given."""

    arrays: Traced  # as the core takes them
    given: tuple[Float64, Float64]  # the origins and directions (n,3) before
    steps: Float64  # (n,) how far they were moved, in lengths of their directions; 0 if they were not
    limits: tuple[Floats, Floats]  # (n,) the tmin and tmax given

    def t(self, t: Floats, ray: NDArray[np.int64] | slice = slice(None)) -> Floats:
        """The t of the rays as they were given, for the t that were found; `ray` has the ray of each."""
        steps, low, high = self.steps[ray], self.limits[0][ray], self.limits[1][ray]
        is_moved = (steps != 0) & np.isfinite(t)
        with np.errstate(over="ignore", invalid="ignore"):
            whole = np.clip((steps + t).astype(t.dtype), low, high)
        return np.where(is_moved, whole, t)


def moved(rays: Rays, arrays: Traced, real: Real, ball: Ball) -> Moved | None:
    """Bring the rays that start far away near; None if there are none.

    `arrays` are the rays as they were rounded. Only float32 scenes, and only rays of other dtypes than that,
    gain by it. Accuracy "exact" takes rays that float32 holds as they are.
    """
    if arrays[0] is rays.origins and arrays[1] is rays.directions:
        return None
    if real is FLOAT64 or not ball.may_have_far(arrays[0]) or rays.are(np.dtype(np.float32)):
        return None
    return _moved(rays, arrays, real, ball)


@np.errstate(over="ignore", invalid="ignore")  # any numbers may be given, signalling NaN among them
def _moved(rays: Rays, arrays: Traced, real: Real, ball: Ball) -> Moved | None:
    given = rays.numpy(FLOAT64)
    origins, directions = (rows.astype(np.float64, copy=False) for rows in given[:2])
    steps = ball.steps(origins, directions)
    if real is EXACT:
        kept = (arrays[0] == origins).all(axis=1) & (arrays[1] == directions).all(axis=1)
        steps[kept] = 0
    is_moved = steps != 0
    if not is_moved.any():
        return None
    low, high = (np.broadcast_to(limit, len(steps)) for limit in arrays[2:])
    near = arrays[0].copy()
    near[is_moved] = ball.starts(origins[is_moved], directions[is_moved], steps[is_moved])
    nearer = np.where(is_moved, _down(_middle(low, -np.inf) - steps), low)
    farther = np.where(is_moved, -_down(steps - _middle(high, np.inf)), high)
    nearer = np.where(
        is_moved & (nearer < 0), np.float32(0), nearer
    )  # nothing lies behind where they are now
    nearer[is_moved & (low > high)] = np.inf
    return Moved((near, arrays[1], nearer, farther), (origins, directions), steps, (low, high))


def _middle(limit: Floats, towards: float) -> Float64:
    """Halfway to the next float: hits up to there have a t that is rounded to the limit."""
    beyond = np.nextafter(limit, np.float32(towards))
    return (limit.astype(np.float64) + beyond) / 2


def _down(values: Float64) -> Floats:
    """float32 numbers that are not above the values."""
    rounded = values.astype(np.float32)
    return np.where(rounded > values, np.nextafter(rounded, np.float32(-np.inf)), rounded)
