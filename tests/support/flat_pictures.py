"""Crossings by brute force: the picture that the watertight test sees along each ray, in Python's integers.

Corners are moved into the space in which the ray is the z axis, rounded there in the mesh's dtype as
docs/accuracy.md says; from then on nothing is rounded.
"""

import numpy as np


def triangles_met(
    vertices: np.ndarray,
    faces: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    touching: bool = False,
) -> np.ndarray:
    """(n,f) whether each ray's line crosses each triangle, or touches it.

    A line crosses a triangle if the point that it is in the picture, moved by (1/B, 1/B^2), lies inside. B is
    so large that no sign but that of zero changes.
    """
    real = vertices.dtype.type
    axes = (np.argmax(np.abs(directions), axis=1)[:, None] + [1, 2, 3]) % 3
    away = vertices[None] - origins[:, None]
    x, y, z = (np.take_along_axis(away, axes[:, None, k : k + 1], axis=2)[..., 0] for k in range(3))
    d = np.take_along_axis(directions, axes, axis=1)
    shear = d[:, :2] / d[:, 2:]
    if real is np.float64:
        shear = np.where(np.abs(shear) < 2.0**-100, 0, shear)
    flat = np.stack([x - shear[:, :1] * z, y - shear[:, 1:] * z], axis=-1)
    assert flat.dtype == real
    points = _integers(flat)
    if not touching:
        big = 1 << (max(abs(int(points.max())), abs(int(points.min()))).bit_length() + 3)
        points = points * big**2 - np.array([big, 1], object)
    a, b, c = points[:, faces].transpose(2, 0, 1, 3)
    sides = [p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0] for p, q in ((b, c), (c, a), (a, b))]
    negative = np.any([side < 0 for side in sides], axis=0)
    positive = np.any([side > 0 for side in sides], axis=0)
    return negative != positive


def _integers(values: np.ndarray) -> np.ndarray:
    ratios = [float(value).as_integer_ratio() for value in values.ravel()]
    unit = max(denominator for _, denominator in ratios)
    whole = [numerator * (unit // denominator) for numerator, denominator in ratios]
    return np.array(whole, object).reshape(values.shape)
