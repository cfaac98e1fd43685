"""Cameras of other kinds than `Camera`, and a spinning lidar: each gives the rays of its picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive._internal import arguments
from wive._internal.picture import LARGEST_SIDE
from wive._internal.picture_rays import perspective, pixel_centres, plane, rays_of, size_of
from wive._internal.poses import Float64, intrinsics_of, pose_of
from wive._internal.precision import Floats
from wive._internal.room import expect_room
from wive._internal.scalars import shown
from wive.camera import view_axes


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """A calibrated pinhole camera, in OpenCV's convention: x to the right, y down, z into the picture.

    Arguments:
        intrinsics: (fx, fy, cx, cy) in pixels, or the matrix (3,3) of the rows fx, skew, cx; 0, fy, cy;
            0, 0, 1. As in OpenCV, the centre of the top left pixel is at 0, 0; if it is at 0.5, 0.5, as in
            COLMAP and Open3D, subtract 0.5 from cx and cy.
        pose: (4,4), camera to world; None is the identity. What OpenCV and Open3D call extrinsic is the
            inverse: np.linalg.inv(extrinsic).

    There is no lens distortion: undistort the picture. `wive.render` takes this camera as well.

    Raises ValueError or TypeError that names the argument.
    """

    intrinsics: ArrayLike
    pose: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Check the arguments."""
        intrinsics_of(self.intrinsics), pose_of(self.pose)

    def rays(self, width: int, height: int, dtype: DTypeLike = np.float64) -> tuple[Floats, Floats]:
        """Origins and directions (h,w,3), as `Camera.rays`: the t of a hit is its depth along z."""
        width, height = size_of(width, height)
        return perspective(self._frame(width, height), width, height, dtype)

    def frame(self, width: int, height: int) -> NDArray[np.float32]:
        """(4,3) float32: the eye, and the vectors that span the picture, as `Camera.frame`."""
        return self._frame(*size_of(width, height)).astype(np.float32)

    def _frame(self, width: int, height: int) -> Float64:
        rotation, eye = pose_of(self.pose)
        onto_plane = rotation @ np.linalg.inv(intrinsics_of(self.intrinsics))
        centre = onto_plane @ ((width - 1) / 2, (height - 1) / 2, 1)
        return np.stack([eye, centre, onto_plane[:, 0] * width / 2, -onto_plane[:, 1] * height / 2])


@dataclass(frozen=True, eq=False)
class OrthographicCamera:
    """A camera of parallel rays.

    Arguments:
        eye, target, up: as of `Camera`; rays start in the plane through the eye.
        view_height: what the picture's height spans, in the scene's units.

    Raises ValueError or TypeError that names the argument.
    """

    eye: ArrayLike
    target: ArrayLike
    up: ArrayLike = (0.0, 1.0, 0.0)
    view_height: float = 1.0

    def __post_init__(self) -> None:
        """Check the arguments."""
        view_axes(self.eye, self.target, self.up)
        if not arguments.real("view_height", self.view_height) > 0:
            raise ValueError(f"view_height must be above 0, got {self.view_height:g}")

    def rays(self, width: int, height: int, dtype: DTypeLike = np.float64) -> tuple[Floats, Floats]:
        """Origins and directions (h,w,3) of the pixels, top row first, with square pixels.

        Directions have length 1: the t of a hit is its depth below the plane through the eye.
        """
        width, height = size_of(width, height)
        forward, right, top = view_axes(self.eye, self.target, self.up)
        half = float(self.view_height) / 2
        eye = arguments.vector("eye", self.eye)
        places = plane(eye, right * half * width / height, top * half, width, height)
        return rays_of(places, (forward,), dtype)


@dataclass(frozen=True, eq=False)
class EquirectangularCamera:
    """A camera that sees all directions: columns are longitudes, rows are latitudes.

    Arguments:
        eye, target, up: as of `Camera`; the target is in the middle of the picture, up is its top row.

    Raises ValueError or TypeError that names the argument.
    """

    eye: ArrayLike
    target: ArrayLike
    up: ArrayLike = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        """Check the arguments."""
        view_axes(self.eye, self.target, self.up)

    def rays(self, width: int, height: int, dtype: DTypeLike = np.float64) -> tuple[Floats, Floats]:
        """Origins and directions (h,w,3) of the pixels, top row first.

        The columns go round once, from behind over the left; `up` is made perpendicular to the view to the
        target. Directions have length 1: the t of a hit is its distance.
        """
        width, height = size_of(width, height)
        forward, right, top = view_axes(self.eye, self.target, self.up)
        axes = np.stack([forward, right, top])
        directions = on_sphere(np.pi * pixel_centres(width), np.pi / 2 * pixel_centres(height)[::-1], axes)
        return rays_of((arguments.vector("eye", self.eye),), (directions,), dtype)


@dataclass(frozen=True, eq=False)
class SpinningLidar:
    """A lidar whose beams turn about its z axis; its picture is a range image, (beams, steps).

    Arguments:
        elevations: (beams,) degrees of each beam above the xy plane, in the order of the image's rows.
        azimuths: how many steps a full turn has, from the x axis towards the y axis; or (steps,) degrees.
        pose: (4,4), lidar to world; None is the identity.

    Raises ValueError or TypeError that names the argument.

    >>> lidar = wive.SpinningLidar(np.linspace(15, -25, 64), 1800, pose)
    >>> ranges = scene.intersect(*lidar.rays(), tmin=0.5, tmax=120).t   # (64,1800), inf if nothing returns
    """

    elevations: ArrayLike
    azimuths: ArrayLike
    pose: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Check the arguments."""
        self._angles(), pose_of(self.pose)

    def rays(self, dtype: DTypeLike = np.float64) -> tuple[Floats, Floats]:
        """Origins and directions (beams, steps, 3). Directions have length 1: the t of a hit is its range."""
        elevations, azimuths = self._angles()
        rotation, position = pose_of(self.pose)
        return rays_of((position,), (on_sphere(azimuths, elevations, rotation.T),), dtype)

    def _angles(self) -> tuple[Float64, Float64]:
        """Elevations and azimuths in radians."""
        elevations = _degrees("elevations", self.elevations)
        if not isinstance(self.azimuths, int | np.integer):
            return elevations, _degrees("azimuths", self.azimuths)
        steps = arguments.integer("azimuths", self.azimuths, 1, LARGEST_SIDE)
        return elevations, 2 * np.pi * np.arange(steps) / steps


def on_sphere(longitudes: Float64, latitudes: Float64, axes: Float64) -> Float64:
    """(latitudes, longitudes, 3) unit vectors: axes[0] lies at 0, 0, axes[1] at 90, 0, axes[2] is up."""
    expect_room(3 * len(longitudes) * len(latitudes), np.float64)
    around = np.stack([np.cos(longitudes), np.sin(longitudes)], axis=1) @ axes[:2]
    return np.asarray(np.cos(latitudes)[:, None, None] * around + np.sin(latitudes)[:, None, None] * axes[2])


def _degrees(name: str, value: ArrayLike) -> Float64:
    """(n,) angles in radians."""
    angles = arguments.nan_if_masked(arguments.array_of_numbers(name, value)).astype(np.float64)
    if angles.ndim != 1:
        count = " or their number" if name == "azimuths" else ""
        raise ValueError(f"{name} must be (n,) angles in degrees{count}, got shape {angles.shape}")
    if not np.isfinite(angles).all():
        raise ValueError(f"{name} must be finite, got {shown(angles.tolist())}")
    return np.radians(angles)
