"""Rays from far away, brought to a float32 scene in float64 before they are traced in float32.

Rounding an origin, a direction or a distance to float32 moves a ray sideways by up to 1e-7 of the way to
the scene: from 1e7 sizes away, by the size of the whole scene. Boxes must allow for that, so such rays would
meet many of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.precision import EXACT, FLOAT64, Floats, Real
from wive._internal.progress import part
from wive._internal.rays import Rays

# From this many radii away, rounding moves a ray by less than 1e-4 radii. Nearer ones are left as they are.
FAR = 256.0
# The largest coordinate of an origin that does not miss, docs/accuracy.md.
MOST_COORDINATE = 1e18

Float64 = NDArray[np.float64]
Traced = tuple[Floats, Floats, Floats, Floats]


class Ball(NamedTuple):
    """A ball that contains all triangles."""

    center: list[float]
    far: float  # from its center, at least two radii

    @classmethod
    def around(cls, bounds: Floats, far: float | None = None) -> Ball:
        """The ball around a box (2,3); if that is empty or infinite, no origin is far."""
        if not np.isfinite(bounds).all():
            return cls([0.0] * 3, np.inf)
        low, high = bounds.astype(np.float64)
        if far is None:
            far = FAR * math.hypot(*(high - low)) / 2
        return cls((low + (high - low) / 2).tolist(), far)

    def may_have_far(self, origins: Floats) -> bool:
        """Whether some origin (n,3) may be far; cheap, and False of most batches."""
        return _cpu.may_have_far(origins, self.center, self.far)

    def just_before(self, origins: Float64, directions: Float64) -> Float64:
        """(n,3) where rays that start far away are two radii before they come nearest to the center.

        The origin of a ray that starts near, or that has the center behind.
        """
        most, before = float(np.finfo(np.float64).max), 2 * self.far / FAR
        return _cpu.nearest_ahead(origins, directions, self.center, self.far, most, before)


class Moved(NamedTuple):
    """Rays of which some start nearer than they were given."""

    arrays: Traced  # as the core takes them
    given: tuple[Floats, Floats]  # in float64, the origins and directions (n,3) before
    steps: Float64  # (n,) how far they were moved, in lengths of their directions; 0 if they were not
    limits: tuple[Floats, Floats]  # (1,) or (n,) the tmin and tmax given

    def t(self, t: Floats, ray: NDArray[np.int64] | slice = slice(None)) -> Floats:
        """The t of the rays as they were given, for the t that were found; `ray` has the ray of each."""
        steps = self.steps[ray]
        low, high = (limit if len(limit) == 1 else limit[ray] for limit in self.limits)
        is_moved = (steps != 0) & np.isfinite(t)
        with np.errstate(over="ignore", invalid="ignore"):
            whole = np.clip((steps + t).astype(t.dtype), low, high)
        return np.where(is_moved, whole, t)


def moved(rays: Rays, arrays: Traced, real: Real, ball: Ball, threads: int = 0) -> Moved | None:
    """Bring the rays that start far away near; None if there are none.

    `arrays` are the rays as they were rounded. Only float32 scenes gain by it. Accuracy "exact" takes rays
    that float32 holds as they are.
    """
    if real is FLOAT64 or not ball.may_have_far(arrays[0]):
        return None
    if real is EXACT and rays.are(np.dtype(np.float32)):
        return None
    origins, directions, *_ = rays.numpy(FLOAT64)
    exact = real is EXACT
    with part(0, 0):  # little of the query
        brought = _cpu.bring_near(
            origins, directions, *arrays, *ball, MOST_COORDINATE, kept=exact, threads=threads
        )
    if brought is None:
        return None
    near, low, high, steps = brought
    return Moved((near, arrays[1], low, high), (origins, directions), steps, arrays[2:])
