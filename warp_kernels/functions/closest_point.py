"""closest_point for users' own kernels: one thread, one point; one overload per handle of a float32 tree."""

from typing import Any

import warp as wp

from wive.warp_kernels.functions.functions import refused
from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.traversal.closest_point import make_closest_point
from wive.warp_kernels.tree.handle import HANDLES, KINDS, USERS_STACK, ClosestPoint


def make_function(accuracy: str, closest_point: wp.Function | None = None) -> wp.Function:
    """The function, with an overload for the handle of one more accuracy; the argument is the one before."""
    kind = accuracy, "float32"
    handle_type, wanted = HANDLES[kind], KINDS.index(kind)
    search = make_closest_point(accuracy, USERS_STACK, "float32", "float32")

    @wp.func
    def closest_point(bvh: handle_type, point: wp.vec3, max_distance: float) -> ClosestPoint:
        """The closest point of the surface, if it is not farther away than max_distance.

        Bit for bit what `wive.Scene.closest` returns, in kernels whose module has `fuse_fp` off. It takes the
        handles of float32 scenes, and has no gradient.
        """
        closest = ClosestPoint()
        closest.distance = wp.inf
        closest.u = wp.nan
        closest.v = wp.nan
        closest.prim = -1
        if not refused(bvh.error, bvh.kind, wanted):
            found = search(bvh, point, max_distance)
            closest.distance = wp.float32(found.distance)
            closest.u = wp.float32(found.u)
            closest.v = wp.float32(found.v)
            closest.prim = found.prim
        return closest

    return closest_point


_function: Any = None
for _accuracy in ("fast", "watertight", "exact"):
    _function = make_function(_accuracy, _function)
for _overload in _function.user_overloads.values():
    without_gradient(_overload)
closest_point = _function
