"""The distance from a point to a triangle: the text of cpu/core/triangle_distance.inc, so the core's bits."""

import warp as wp

from wive import _cpu
from wive.warp_kernels.lanes.lanes import without_gradient

_MEASURE = (
    _cpu.distance_source
    + """
    TriangleDistance distance;
    distance.measure(Double3::load(corners.data[0]), Double3::load(corners.data[1]),
                     Double3::load(corners.data[2]), Double3::load(&point[0]));
"""
)


@wp.func_native(_MEASURE + "    return distance.squared();")
def squared_distance(corners: wp.mat33d, point: wp.vec3d) -> wp.float64:
    """The squared distance to a triangle; corners as rows, NaN if one is NaN."""
    ...


@wp.func_native(
    _MEASURE
    + """
    double uv[2];
    distance.weights(uv);
    return wp::vec_t<2, wp::float64>(uv[0], uv[1]);
"""
)
def closest_weights(corners: wp.mat33d, point: wp.vec3d) -> wp.vec2d:
    """u and v of the closest point of a triangle."""
    ...


for _function in (squared_distance, closest_weights):
    without_gradient(_function)
