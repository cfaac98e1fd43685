"""The truth by brute force: every ray against every triangle in integers and fractions, nothing rounded.

It shares no formula with the core beyond the definition: the line o + t d meets the triangle (a, b, c) at
t = (a - o) . n / (d . n), n = (b - a) x (c - a), and the point's barycentrics are ratios of volumes.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

LARGEST = Fraction(np.finfo(np.float32).max.item())
OVERFLOW = LARGEST + Fraction(2) ** 103  # half a unit in the last place above: rounds to infinity


def integers(values: np.ndarray, unit: int) -> np.ndarray:
    """values / 2^unit as Python integers; unit must divide them all."""
    mantissa, exponent = np.frexp(values.astype(np.float64))
    whole = (mantissa * 2.0**24).astype(np.int64).astype(object)
    shifts = np.where(values == 0, 0, exponent - 24 - unit).astype(object)
    powers = np.array([2 ** int(s) if s >= 0 else 0 for s in shifts.ravel()], object).reshape(shifts.shape)
    odd = shifts < 0  # trailing zero bits make up for it
    return np.where(odd, whole // np.array([2 ** max(0, -int(s)) for s in shifts.ravel()], object).reshape(shifts.shape), whole * powers)


def unit_of(*arrays: np.ndarray) -> int:
    """The exponent of a power of two of which all values are multiples."""
    exponents = [np.frexp(a[a != 0].astype(np.float64))[1].min(initial=0) for a in arrays]
    return int(min(exponents)) - 24


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def nearest_float(x: Fraction) -> np.float32:
    """The float32 nearest to x, ties to even; a zero is +0."""
    if abs(x) >= OVERFLOW:
        return np.float32(np.inf if x > 0 else -np.inf)
    guess = np.float32(float(min(max(x, -LARGEST), LARGEST)))
    around = [guess, np.nextafter(guess, np.float32(np.inf)), np.nextafter(guess, np.float32(-np.inf))]
    finite = [f for f in around if np.isfinite(f)]
    best = min(finite, key=lambda f: (abs(Fraction(f.item()) - x), int(f.view(np.uint32)) & 1))
    return best + np.float32(0)


@dataclass(frozen=True)
class Truth:
    """What `closest` and `any` must return, to the bit, and how many triangles each ray crosses."""

    t: np.ndarray
    prim: np.ndarray
    uv: np.ndarray
    occluded: np.ndarray


@dataclass(frozen=True)
class Meetings:
    """Each line (n) against each triangle (f): whether it meets it, and t = height / determinant * scale."""

    inside: np.ndarray  # (n, f) closed triangles, not edge-on
    weights: np.ndarray  # (n, f, 3) volumes opposite to each corner
    determinant: np.ndarray  # (n, f)
    height: np.ndarray  # (n, f)
    scale: Fraction

    def t(self, ray: int, face: int) -> Fraction:
        return Fraction(self.height[ray, face], self.determinant[ray, face]) * self.scale


def meetings(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> Meetings:
    unit, direction_unit = unit_of(vertices, origins), unit_of(directions)
    a, b, c = integers(vertices, unit)[faces].swapaxes(0, 1)[:, None]
    o, d = integers(origins, unit)[:, None], integers(directions, direction_unit)[:, None]
    normal = cross(b - a, c - a)
    determinant = dot(d, normal)
    height = dot(a - o, normal)
    weights = np.stack(
        [dot(d, cross(b - o, c - o)), dot(d, cross(c - o, a - o)), dot(d, cross(a - o, b - o))], axis=-1
    )
    turned = weights * np.where(determinant < 0, -1, 1)[..., None]
    inside = (determinant != 0) & (turned >= 0).all(axis=-1)
    return Meetings(inside, weights, determinant, height, Fraction(2) ** (unit - direction_unit))


def truth(
    vertices: np.ndarray,
    faces: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    tmin: np.ndarray,
    tmax: np.ndarray,
) -> Truth:
    """The answers to every query; tmin, tmax (1,) or (n,)."""
    met = meetings(vertices, faces, origins, directions)
    count = len(origins)
    tmin, tmax = np.broadcast_to(tmin, count), np.broadcast_to(tmax, count)
    t = np.full(count, np.inf, np.float32)
    uv = np.full((count, 2), np.nan, np.float32)
    prim = np.full(count, -1, np.int32)
    for ray in range(count):
        hits = [(met.t(ray, face), int(face)) for face in np.flatnonzero(met.inside[ray])]
        hits = [hit for hit in hits if tmin[ray] <= hit[0] <= tmax[ray]]
        if not hits:
            continue
        distance, face = min(hits)
        t[ray], prim[ray] = nearest_float(distance), face
        for k in range(2):
            uv[ray, k] = nearest_float(
                Fraction(met.weights[ray, face, k + 1], met.determinant[ray, face])
            )
    return Truth(t, prim, uv, prim >= 0)
