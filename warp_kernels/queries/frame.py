"""A ray made ready for traversal: checked, scaled, with reciprocals and slab offsets.

The operations are those of cpu/traverse/frame.h, in the same order.
"""

import functools
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.lanes import larger, rounded_as_written
from wive.warp_kernels.lanes.layout import SIGN_BIT
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.limits import make_scale_limits, next_above

MAX_COORDINATE = 1e18
MAX_FLOAT = 3.4028234663852886e38
MAX_DOUBLE = 1.7976931348623157e308
SMALLEST_PART = wp.constant(wp.float32(2.0**-30))
LEAST_MAGNITUDE = wp.constant(wp.float32(2.0**-100))
SUBNORMAL_STEP = wp.constant(wp.float32(2.0**-148))
SLACK_FACTOR = wp.constant(wp.float32(2.0**-20))
# Make any subnormal number normal.
NORMALISE = wp.constant(wp.float32(2.0**24))
NORMALISE_64 = wp.constant(wp.float64(2.0**53))
LEAST_NORMAL = wp.constant(wp.float32(2.0**-126))
LEAST_NORMAL_64 = wp.constant(wp.float64(2.0**-1022))


@wp.struct
class RayFrame:
    """A ray in the frame's units; cpu/traverse/frame.h derives its bounds."""

    origin: wp.vec3
    direction: wp.vec3  # scaled by a power of two: its longest component lies in [1, 2)
    rdir: wp.vec3
    near_bias: wp.vec3
    far_bias: wp.vec3
    tmin: wp.float32
    tmax: wp.float32
    unscale: wp.float32  # a power of two; t here = unscale * t of the caller's ray
    octant: wp.int32  # bit a: negative on axis a, from the sign of the reciprocal
    longest_axis: wp.int32
    given_direction: wp.vec3  # this and the limits below as the caller gave them, for exact trees
    given_tmin: wp.float32
    given_tmax: wp.float32
    valid: wp.bool  # false if the ray misses by rule: NaN, out of range, zero direction, empty interval


@wp.struct
class RayFrame64:
    """A ray in a float64 tree: the ray's own numbers in double, those for boxes in float32."""

    origin: wp.vec3d
    direction: wp.vec3d
    rdir: wp.vec3
    near_bias: wp.vec3
    far_bias: wp.vec3
    tmin: wp.float64
    tmax: wp.float64
    box_tmin: wp.float32  # tmin rounded down
    unscale: wp.float64
    octant: wp.int32
    longest_axis: wp.int32
    valid: wp.bool


FRAMES = {"float32": RayFrame, "float64": RayFrame64}


@wp.func
def is_negative(x: float):
    """Whether the sign bit is set, which is true of -0.0."""
    return wp.cast(x, wp.int32) < 0


@wp.func
def is_negative(x: wp.float64):
    return wp.cast(x, wp.int64) < wp.int64(0)


@wp.func
def flip_sign(x: float, sign: float):
    """x, negated if `sign` has its sign bit set; by the bit, because Warp's -x is 0 - x and loses -0."""
    return wp.cast(wp.cast(x, wp.uint32) ^ (wp.cast(sign, wp.uint32) & SIGN_BIT), wp.float32)


@wp.func
def flip_sign(x: wp.float64, sign: wp.float64):
    bit = wp.cast(sign, wp.uint64) & wp.uint64(0x8000000000000000)
    return wp.cast(wp.cast(x, wp.uint64) ^ bit, wp.float64)


@wp.func
def box_tmax(t: float):
    """t rounded up to float32, for boxes."""
    return t


@wp.func
def box_tmax(t: wp.float64):
    rounded = wp.float32(t)
    if wp.float64(rounded) < t:
        rounded = next_above(rounded)
    return rounded


@wp.func
def box_tmin(ray: RayFrame):
    """The ray's tmin rounded down to float32, for boxes."""
    return ray.tmin


@wp.func
def box_tmin(ray: RayFrame64):
    return ray.box_tmin


@wp.func
def power_of(longest: float):
    """The largest power of two not above the longest component, which may be subnormal."""
    small = longest < LEAST_NORMAL
    exponent = wp.cast(longest * wp.where(small, NORMALISE, 1.0), wp.uint32) >> wp.uint32(23)
    return wp.cast(exponent << wp.uint32(23), wp.float32) * wp.where(small, 1.0 / NORMALISE, 1.0)


@wp.func
def power_of(longest: wp.float64):
    up = wp.where(longest < LEAST_NORMAL_64, NORMALISE_64, wp.float64(1.0))
    exponent = wp.cast(longest * up, wp.uint64) >> wp.uint64(52)
    return wp.cast(exponent << wp.uint64(52), wp.float64) / up


@wp.func
def by_sheared_axis(v: Any, longest: int):
    """v by the axes of the triangle tests' sheared space, the direction's longest axis last.

    By selection: an index unknown to the compiler would put v into memory.
    """
    x = wp.where(longest == 0, v[1], wp.where(longest == 1, v[2], v[0]))
    y = wp.where(longest == 0, v[2], wp.where(longest == 1, v[0], v[1]))
    z = wp.where(longest == 0, v[0], wp.where(longest == 1, v[1], v[2]))
    return type(v)(x, y, z)


@wp.func
def axes_of(longest: int):
    """The mesh axis of each sheared axis."""
    return by_sheared_axis(wp.vec3i(0, 1, 2), longest)


@functools.cache
def make_load_frame(accuracy: str, precision: str) -> wp.Function:
    """The function that makes a ray ready for trees of this accuracy and precision."""
    frame_type, exact = FRAMES[precision], accuracy == "exact"
    numbers = PRECISIONS[precision]
    real, vec3 = numbers.real, numbers.vec3
    scale_limits = make_scale_limits(precision)
    double: bool = precision == "float64"
    max_coordinate = real(MAX_COORDINATE)
    max_component = real(MAX_DOUBLE if double else MAX_FLOAT)

    @wp.func
    def load_frame(center: wp.vec3, origin: vec3, direction: vec3, tmin: real, tmax: real):
        """The frame of a ray in a tree with this center."""
        rounded_as_written()
        ray = frame_type()
        lengths = vec3(wp.abs(direction[0]), wp.abs(direction[1]), wp.abs(direction[2]))
        longest = larger(larger(lengths[0], lengths[1]), lengths[2])
        ray.valid = longest > real(0.0) and tmin <= tmax
        for axis in range(3):
            if not (wp.abs(origin[axis]) <= max_coordinate and lengths[axis] <= max_component):
                ray.valid = False

        ray.unscale = power_of(longest)
        if wp.static(exact):
            # For boxes: a t that is subnormal or infinite may have been rounded into the interval by more
            # than their slack.
            ray.tmin = (wp.min(tmin, max_component) - SUBNORMAL_STEP) * ray.unscale
            ray.tmax = (wp.max(tmax, -max_component) + SUBNORMAL_STEP) * ray.unscale
        else:
            limits = scale_limits(tmin, tmax, ray.unscale)
            ray.tmin = limits[0]
            ray.tmax = limits[1]
        ray.origin = origin
        ray.direction = direction / ray.unscale
        scaled = wp.vec3()
        relative = wp.vec3()
        for axis in range(3):
            scaled[axis] = wp.float32(ray.direction[axis])
            relative[axis] = wp.float32(origin[axis] - real(center[axis]))
        if wp.static(double):
            ray.box_tmin = -box_tmax(-ray.tmin)
        else:
            ray.given_direction = direction
            ray.given_tmin = tmin
            ray.given_tmax = tmax

        magnitude = float(0.0)
        for axis in range(3):
            magnitude = larger(magnitude, wp.abs(relative[axis]))
        magnitude = magnitude + LEAST_MAGNITUDE
        smallest = wp.float32(longest / ray.unscale) * SMALLEST_PART
        for axis in range(3):
            size = 1.0 / larger(wp.abs(scaled[axis]), smallest)
            reciprocal = flip_sign(size, scaled[axis])
            distance = relative[axis] * reciprocal
            slack = size * (magnitude * SLACK_FACTOR)
            ray.rdir[axis] = reciprocal
            ray.near_bias[axis] = 0.0 - (distance + slack)
            ray.far_bias[axis] = slack - distance
            if is_negative(ray.direction[axis]):
                ray.octant = ray.octant | (1 << axis)
        ray.longest_axis = wp.where(lengths[0] == longest, 0, wp.where(lengths[1] == longest, 1, 2))
        return ray

    return load_frame
