"""Random numbers and directions, in NumPy as in cpu/core/random.h and cpu/render/light.h.

Sums, products and roots alone, each rounded on its own: the same bits on every processor and for any tiling.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wive._internal.precision import Floats

UInt32 = NDArray[np.uint32]

QUARTER_PI = 0.785398163
UNIT_STEP = 2.0**-24


def pcg4d(pixel: UInt32, sample: int, dimension: int, seed: int) -> list[UInt32]:
    """Four random words per pixel: PCG4D of Jarzynski and Olano 2020."""
    a, c = np.uint32(1664525), np.uint32(1013904223)
    words = [pixel * a + c]
    words += [
        np.full_like(pixel, (number * 1664525 + 1013904223) & 0xFFFFFFFF)
        for number in (sample, dimension, seed)
    ]
    _mix(words)
    for word in words:
        word ^= word >> np.uint32(16)
    _mix(words)
    return words


def _mix(words: list[UInt32]) -> None:
    x, y, z, w = words
    x += y * w
    y += z * x
    z += x * y
    w += y * z


def to_unit(bits: UInt32, dtype: np.dtype[np.floating]) -> Floats:
    """Numbers in [0, 1) from the high 24 bits."""
    return np.asarray((bits >> np.uint32(8)).astype(dtype) * dtype.type(UNIT_STEP))


def cosine_directions(normals: Floats, random_a: Floats, random_b: Floats) -> Floats:
    """(n,3) cosine-distributed directions about unit normals (n,3), in their dtype."""
    real = normals.dtype.type
    a, b = real(2) * random_a - real(1), real(2) * random_b - real(1)
    along_a = abs(a) > abs(b)
    radius, other = np.where(along_a, a, b), np.where(along_a, b, a)
    angle = real(QUARTER_PI) * (other / np.where(radius == 0, real(1), radius))
    s = angle * angle
    sine = angle * (1 + s * (real(-1 / 6) + s * (real(1 / 120) + s * real(-1 / 5040))))
    cosine = 1 + s * (real(-0.5) + s * (real(1 / 24) + s * (real(-1 / 720) + s * real(1 / 40320))))
    x, y = radius * np.where(along_a, cosine, sine), radius * np.where(along_a, sine, cosine)
    z = np.sqrt(np.maximum(real(0), 1 - x * x - y * y))
    # Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    nx, ny, nz = normals.T
    sign = np.copysign(real(1), nz)
    p = real(-1) / (sign + nz)
    q = nx * ny * p
    directions = np.empty_like(normals)
    directions[:, 0] = (1 + sign * nx * nx * p) * x + q * y + nx * z
    directions[:, 1] = sign * q * x + (sign + ny * ny * p) * y + ny * z
    directions[:, 2] = -sign * nx * x - ny * y + nz * z
    return directions
