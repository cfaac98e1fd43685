"""Checks on poses and intrinsics: matrices that place a sensor and describe its lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments
from wive._internal.scalars import shown

# How far the columns of a rotation may be from orthonormal: rounded to float32 they are off by 1e-7.
ROUNDED = 1e-4

Float64 = NDArray[np.float64]


def pose_of(value: ArrayLike | None) -> tuple[Float64, Float64]:
    """Rotation (3,3) and position (3,) of a pose (4,4), sensor to world; None is the world's own axes."""
    if value is None:
        return np.eye(3), np.zeros(3)
    matrix = _finite("pose", value, "a (4, 4) matrix")
    if matrix.shape != (4, 4):
        raise ValueError(f"pose must be a (4, 4) matrix, sensor to world, got shape {matrix.shape}")
    rotation, position = matrix[:3, :3], matrix[:3, 3]
    with np.errstate(over="ignore", invalid="ignore"):
        is_rotation = abs(rotation.T @ rotation - np.eye(3)).max() < ROUNDED and np.linalg.det(rotation) > 0
    if not (is_rotation and (matrix[3] == (0, 0, 0, 1)).all()):
        raise ValueError(
            "pose must be a rotation without scale or mirror, a translation in its last column and the last "
            f"row 0, 0, 0, 1, got {shown(matrix.tolist())}"
        )
    return rotation, position


def intrinsics_of(value: ArrayLike) -> Float64:
    """The (3,3) matrix of (fx, fy, cx, cy) or of itself."""
    matrix = _finite("intrinsics", value, "(fx, fy, cx, cy) or a (3, 3) matrix")
    if matrix.shape == (4,):
        fx, fy, cx, cy = matrix
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    if matrix.shape != (3, 3):
        raise ValueError(f"intrinsics must be (fx, fy, cx, cy) or a (3, 3) matrix, got shape {matrix.shape}")
    if matrix[1, 0] != 0 or (matrix[2] != (0, 0, 1)).any():
        raise ValueError(
            "intrinsics must be a matrix of the rows fx, skew, cx; 0, fy, cy; 0, 0, 1, "
            f"got {shown(matrix.tolist())}"
        )
    if not min(matrix[0, 0], matrix[1, 1]) > 0:
        raise ValueError(f"intrinsics must have fx and fy above 0, got {matrix[0, 0]:g} and {matrix[1, 1]:g}")
    return matrix


def _finite(name: str, value: ArrayLike, expected: str) -> Float64:
    array = arguments.array_of_numbers(name, value)
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = arguments.nan_if_masked(array).astype(np.float64)
    if not np.isfinite(numbers).all():
        raise ValueError(f"{name} must be {expected} of finite numbers, got {shown(numbers.tolist())}")
    return numbers
