"""A pinhole camera, and where to put it so that a mesh fills the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments

# A mesh is flat, with up along its thinnest axis, if it is this much thinner on that axis than on the others.
FLATNESS = 0.4
# From the mesh to the eye: to the right, in front, above.
VIEWPOINT = (0.55, 1.0, 0.6)
# The fraction of the picture that a framed mesh fills.
FILLED = 0.94


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Arguments:
        eye: (3,) position of the camera.
        target: (3,) the point in the middle of the picture.
        up: (3,) the direction that is up in the picture; of any length, not along the view.
        fov: vertical field of view in degrees, between 0 and 180.

    Raises ValueError if these leave no picture: eye at the target, up along the view, fov out of range.
    """

    eye: ArrayLike
    target: ArrayLike
    up: ArrayLike = (0.0, 1.0, 0.0)
    fov: float = 40.0

    def __post_init__(self) -> None:
        """Check the arguments."""
        self._axes()

    @classmethod
    def framing(
        cls, bounds: ArrayLike, up: ArrayLike | None = None, fov: float = 40.0, aspect: float = 16 / 9
    ) -> Camera:
        """A camera from which a box just fits into the picture.

        Arguments:
            bounds: (2,3) lowest and highest corner, such as `Scene.bounds`.
            up: (3,); None is the axis of the smallest extent if the box is clearly flat, else y.
            fov: vertical, in degrees.
            aspect: the picture's width divided by its height.
        """
        low, high = np.asarray(bounds, np.float64).reshape(2, 3)
        if not np.isfinite([low, high]).all():
            raise ValueError("bounds must be finite to be framed: the mesh has no triangle that can be hit")
        up_vector = _flat_axis(high - low) if up is None else arguments.vector("up", up)
        right, front = _ground_axes(up_vector)
        viewpoint = VIEWPOINT @ np.stack([right, front, up_vector / np.linalg.norm(up_vector)])
        centre = (low + high) / 2
        forward, to_right, to_top = cls(centre + viewpoint, centre, up_vector, fov)._axes()

        corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
        tangent = FILLED * math.tan(math.radians(fov) / 2)
        across, back_across = _squeeze(corners - centre, forward, to_right, tangent * aspect)
        upward, back_upward = _squeeze(corners - centre, forward, to_top, tangent)
        back = max(back_across, back_upward) or 1.0
        eye = centre + across * to_right + upward * to_top - back * forward
        return cls(eye, eye + back * forward, up_vector, fov)

    def frame(self, width: int, height: int) -> NDArray[np.float32]:
        """(4,3) float32: the eye, and the vectors that span the picture.

        They go from the eye to the picture's centre, from there to the middle of the right edge, and to the
        middle of the top edge.
        """
        forward, right, top = self._axes()
        tangent = math.tan(math.radians(self.fov) / 2)
        eye = arguments.vector("eye", self.eye)
        return np.stack([eye, forward, right * tangent * width / height, top * tangent]).astype(np.float32)

    def _axes(self) -> NDArray[np.float64]:
        """(3,3) unit vectors: forward, right, top."""
        fov = arguments.real("fov", self.fov)
        if not 0 < fov < 180:
            raise ValueError(f"fov must be between 0 and 180 degrees, got {fov:g}")
        forward = arguments.vector("target", self.target) - arguments.vector("eye", self.eye)
        if not forward.any():
            raise ValueError(f"eye and target must differ, got {self.eye!r} for both")
        forward /= np.linalg.norm(forward)
        up = arguments.vector("up", self.up)
        right = np.cross(forward, up)
        if np.linalg.norm(right) <= 1e-9 * np.linalg.norm(up):
            raise ValueError(f"up must not be zero or along the view, got {self.up!r}")
        right /= np.linalg.norm(right)
        return np.stack([forward, right, np.cross(right, forward)])


def _squeeze(
    corners: NDArray[np.float64], forward: NDArray[np.float64], side: NDArray[np.float64], tangent: float
) -> tuple[float, float]:
    """How far to the side and back to put the eye so that its view just contains all corners.

    Two planes through the eye bound the view; they rise by `tangent` to either side per unit forward.
    """
    sideways, depth = corners @ side, tangent * (corners @ forward)
    one, other = np.max(sideways - depth), np.max(-sideways - depth)
    return float(one - other) / 2, float(one + other) / (2 * tangent)


def _flat_axis(extent: NDArray[np.float64]) -> NDArray[np.float64]:
    thinnest, thinner, _ = (int(axis) for axis in np.argsort(extent, kind="stable"))
    is_flat = extent[thinnest] < FLATNESS * extent[thinner]
    axis = np.zeros(3)
    axis[thinnest if is_flat else 1] = 1.0
    return axis


def _ground_axes(up: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the right and towards the viewer: x and z if up is y, x and -y if up is z."""
    across = np.eye(3)[1 if abs(up[0]) == np.max(abs(up)) else 0]
    front = np.cross(across, up)
    front /= np.linalg.norm(front)
    right = np.cross(up, front)
    return right / np.linalg.norm(right), front
