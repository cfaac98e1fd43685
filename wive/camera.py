"""A pinhole camera, and where to put it so that a mesh fills the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive._internal import arguments
from wive._internal.picture_rays import perspective, size_of
from wive._internal.precision import Floats
from wive._internal.scalars import MOST_COUNT, shown

if TYPE_CHECKING:
    from wive.scene import Scene

# A mesh is flat, with up along its thinnest axis, if it is this much thinner on that axis than on the others.
FLATNESS = 0.4
# From the mesh to the eye: to the right, in front, above.
VIEWPOINT = (0.55, 1.0, 0.6)
VIEWPOINT_OF_FLAT = (0.4, 1.0, 0.85)
# The fraction of the picture that a framed mesh fills.
FILLED = 0.94
# The sine of the smallest angle between the view and `up`.
SMALLEST_ANGLE = 1e-9
# The shortest view relative to the coordinates: four units in the last place.
NEAREST = 2.0**-21
# Pictures are rendered in float32.
LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Arguments:
        eye: (3,) position of the camera.
        target: (3,) the point in the middle of the picture.
        up: (3,) the direction that is up in the picture; of any length, not along the view.
        fov: vertical field of view in degrees, between 0 and 180.

    Raises ValueError if these leave no picture: eye at the target, up along the view, fov out of range, a
    number that is NaN or beyond float32; TypeError for what is no number.
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

        Raises ValueError or TypeError that names the argument of no sense.
        """
        low, high = arguments.bounds(bounds, LARGEST)
        corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
        return framing_points(corners, up, fov, aspect)

    @classmethod
    def showing(
        cls, scene: Scene, up: ArrayLike | None = None, fov: float | None = None, aspect: float = 16 / 9
    ) -> Camera:
        """The camera that `wive.render` takes by default: where most of the scene's front sides is seen.

        It frames the scene from outside as `framing` does, or stands in the room that the scene is: if from
        there more of the sides that normals point to is seen. Surfaces and eyes are sampled, in tenths of a
        second, the same at each call.

        Arguments:
            up: (3,); None is as for `framing`; in rooms y, or z if most level surfaces face it.
            fov: vertical, in degrees; None is 40 outside and 65 in rooms.
            aspect: the picture's width divided by its height.

        Raises ValueError or TypeError that names the argument of no sense, or if nothing can be hit.
        """
        from wive._internal.pictures.viewpoint import default_camera

        return default_camera(scene, up, fov, aspect)

    def frame(self, width: int, height: int) -> NDArray[np.float32]:
        """(4,3) float32: the eye, and the vectors that span the picture.

        They go from the eye to the picture's centre, from there to the middle of the right edge, and to the
        middle of the top edge.
        """
        return self._frame(*size_of(width, height, MOST_COUNT)).astype(np.float32)

    def rays(self, width: int, height: int, dtype: DTypeLike = np.float64) -> tuple[Floats, Floats]:
        """Origins and directions (h,w,3) of the rays through a picture's pixel centres, top row first.

        Directions have length 1 along the view, so that the t of a hit is its depth along the camera's axis.
        `wive.render` takes its rays from the same pixels.

        Arguments:
            width, height: of the picture, in pixels.
            dtype: np.float64, or np.float32 for rays that a float32 scene takes without a copy.

        Raises ValueError or TypeError that names a bad argument.

        >>> hits = scene.intersect(*camera.rays(640, 480))
        >>> depth = hits.t   # (480,640), inf on a miss
        """
        width, height = size_of(width, height)
        return perspective(self._frame(width, height), width, height, dtype)

    def _frame(self, width: int, height: int) -> NDArray[np.float64]:
        forward, right, top = self._axes()
        tangent = math.tan(math.radians(self.fov) / 2)
        eye = arguments.vector("eye", self.eye)
        return np.stack([eye, forward, right * tangent * width / height, top * tangent])

    def _axes(self) -> NDArray[np.float64]:
        _field_of_view(self.fov)
        return view_axes(self.eye, self.target, self.up)


def framing_points(points: NDArray[np.float64], up: ArrayLike | None, fov: float, aspect: float) -> Camera:
    """`Camera.framing` for points (n,3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    fov, aspect = _field_of_view(fov), arguments.real("aspect", aspect)
    if aspect <= 0:
        raise ValueError(f"aspect must be above 0, got {aspect:g}")
    up_vector = _flat_axis(high - low) if up is None else unit_vector("up", up)
    right, front = ground_axes(up_vector)
    axes = np.stack([right, front, up_vector])
    across_ground, into_ground, height = np.ptp((points - low) @ axes.T, axis=0)
    is_flat = height < FLATNESS * min(across_ground, into_ground)
    viewpoint = (VIEWPOINT_OF_FLAT if is_flat else VIEWPOINT) @ axes
    centre = (low + high) / 2
    forward, to_right, to_top = Camera(viewpoint, np.zeros(3), up_vector, fov)._axes()

    tangent = FILLED * math.tan(math.radians(fov) / 2)
    if not (tangent > 1 / LARGEST and 1 / LARGEST < tangent * aspect < LARGEST):
        raise ValueError(f"fov and aspect leave no picture, got fov {fov:g} and aspect {aspect:g}")
    across, back_across = _squeeze(points - centre, forward, to_right, tangent * aspect)
    upward, back_upward = _squeeze(points - centre, forward, to_top, tangent)
    # Not so close that eye and target are one in float32.
    back = max(back_across, back_upward, NEAREST * float(np.max(abs(centre)))) or 1.0
    if back > LARGEST:
        raise ValueError(f"fov and aspect must be larger for these bounds, got {fov:g} and {aspect:g}")
    eye = centre + across * to_right + upward * to_top - back * forward
    return Camera(eye, eye + back * forward, up_vector, fov)


def view_axes(eye: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """(3,3) unit vectors of a view: forward, right, top."""
    ends = arguments.vector("eye", eye), arguments.vector("target", target)
    for name, end in zip(("eye", "target"), ends, strict=True):
        if np.max(abs(end)) > LARGEST:
            raise ValueError(f"{name} must be at most {LARGEST:.3g} in magnitude, got {end.tolist()}")
    if (ends[0] == ends[1]).all():
        raise ValueError(f"eye and target must differ, got {shown(eye)} for both")
    forward = _unit(ends[1] - ends[0])
    right = np.cross(forward, unit_vector("up", up))
    if np.linalg.norm(right) <= SMALLEST_ANGLE:
        raise ValueError(f"up must not be zero or along the view, got {shown(up)}")
    right /= np.linalg.norm(right)
    return np.stack([forward, right, np.cross(right, forward)])


def _field_of_view(fov: float) -> float:
    degrees = arguments.real("fov", fov)
    if not 0 < degrees < 180:
        raise ValueError(f"fov must be between 0 and 180 degrees, got {degrees:g}")
    return degrees


def unit_vector(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """A unit vector along `value`."""
    vector = arguments.vector(name, value)
    if not vector.any():
        raise ValueError(f"{name} must not be zero or along the view, got {shown(value)}")
    return _unit(vector)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """A vector's direction; its squares may be beyond float64."""
    scaled = vector / np.max(abs(vector))
    unit: NDArray[np.float64] = scaled / np.linalg.norm(scaled)
    return unit


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


def ground_axes(up: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the right and towards the viewer: x and z if up is y, x and -y if up is z."""
    across = np.eye(3)[1 if abs(up[0]) == np.max(abs(up)) else 0]
    front = np.cross(across, up)
    front /= np.linalg.norm(front)
    right = np.cross(up, front)
    return right / np.linalg.norm(right), front
