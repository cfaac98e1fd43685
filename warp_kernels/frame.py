"""A ray made ready for traversal, as in cpu/frame.h: checked, scaled, reciprocal and slab offsets taken."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import warp as wp

from wive.warp_kernels.handle import SIGN_BIT

MAX_COORDINATE = wp.constant(wp.float32(1e18))
MAX_FLOAT = wp.constant(wp.float32(3.4028234663852886e38))
SMALLEST_PART = wp.constant(wp.float32(2.0**-30))
LEAST_REACH = wp.constant(wp.float32(2.0**-100))
SLACK_FACTOR = wp.constant(wp.float32(2.0**-20))


@wp.struct
class RayFrame:
    """See cpu/frame.h for what each is and why it is enough."""

    origin: wp.vec3
    direction: wp.vec3  # scaled by a power of two: its longest component lies in [1, 2)
    rdir: wp.vec3
    near_bias: wp.vec3
    far_bias: wp.vec3
    tmin: wp.float32
    tmax: wp.float32
    scale: wp.float32  # t of the caller's ray = scale * t here
    octant: wp.int32  # bit a: negative on axis a, from the sign of the reciprocal
    longest_axis: wp.int32
    given_direction: wp.vec3  # as the caller gave them: exact trees alone need these three
    given_tmin: wp.float32
    given_tmax: wp.float32
    valid: wp.bool  # false where the ray hits nothing by rule


@wp.func
def is_negative(x: float):
    """Whether the sign bit is set: true of -0.0."""
    return wp.cast(x, wp.int32) < 0


@wp.func
def flip_sign(x: float, sign: float):
    """x, negated where `sign` has its sign bit set; by the bit, because Warp's -x is 0 - x and loses -0."""
    return wp.cast(wp.cast(x, wp.uint32) ^ (wp.cast(sign, wp.uint32) & SIGN_BIT), wp.float32)


@wp.func
def component(v: wp.vec3, axis: int):
    """v[axis] by selection: an index unknown to the compiler would put v into memory."""
    return wp.where(axis == 0, v[0], wp.where(axis == 1, v[1], v[2]))


@wp.func
def axes_of(longest: int):
    """The axes in the order of the triangle tests' sheared space, the direction's longest last."""
    x = wp.where(longest == 2, 0, longest + 1)
    return wp.vec3i(x, wp.where(x == 2, 0, x + 1), longest)


@wp.func
def load_frame(
    center: wp.vec3, extent: wp.vec3, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float
):
    """The frame of a ray in a tree with this center and extent."""
    ray = RayFrame()
    lengths = wp.vec3(wp.abs(direction[0]), wp.abs(direction[1]), wp.abs(direction[2]))
    longest = wp.max(wp.max(lengths[0], lengths[1]), lengths[2])
    ray.valid = longest > 0.0 and tmin <= tmax
    for axis in range(3):
        if not (wp.abs(origin[axis]) <= MAX_COORDINATE and lengths[axis] <= MAX_FLOAT):
            ray.valid = False

    exponent = wp.min(wp.cast(longest, wp.uint32) >> wp.uint32(23), wp.uint32(253))
    unscale_bits = wp.where(exponent > wp.uint32(0), exponent << wp.uint32(23), wp.uint32(1) << wp.uint32(22))
    ray.scale = wp.cast((wp.uint32(254) - exponent) << wp.uint32(23), wp.float32)
    unscale = wp.cast(unscale_bits, wp.float32)
    ray.tmin = tmin * unscale
    ray.tmax = tmax * unscale

    ray.origin = origin
    ray.given_direction = direction
    ray.given_tmin = tmin
    ray.given_tmax = tmax
    ray.direction = direction * ray.scale
    relative = origin - center
    reach = float(0.0)  # noqa: UP018
    for axis in range(3):
        reach = wp.max(reach, extent[axis] + wp.abs(relative[axis]))
    reach = reach + LEAST_REACH
    smallest = longest * ray.scale * SMALLEST_PART
    for axis in range(3):
        size = 1.0 / wp.max(wp.abs(ray.direction[axis]), smallest)
        reciprocal = flip_sign(size, ray.direction[axis])
        distance = relative[axis] * reciprocal
        slack = size * (reach * SLACK_FACTOR)
        ray.rdir[axis] = reciprocal
        ray.near_bias[axis] = 0.0 - (distance + slack)
        ray.far_bias[axis] = slack - distance
        if is_negative(ray.direction[axis]):
            ray.octant = ray.octant | (1 << axis)
    ray.longest_axis = wp.where(lengths[0] == longest, 0, wp.where(lengths[1] == longest, 1, 2))
    return ray
