"""The path tracer's kernels on Warp: operation by operation those of render.cpp, so that pictures agree.

In both, every float operation is rounded on its own: no fused multiply-adds, no reordering.
"""

# mypy: disable-error-code="untyped-decorator"

import numpy as np
import warp as wp

from wive.warp_kernels.scene.surfaces import vertices_of

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

ONE = np.float32(1)
QUARTER_PI = wp.constant(wp.float32(0.785398163))
# Taylor series of sine and cosine, as in cpu/render/render.cpp, each divided in float.
SINE_3 = wp.constant(wp.float32(-ONE / np.float32(6)))
SINE_5 = wp.constant(wp.float32(ONE / np.float32(120)))
SINE_7 = wp.constant(wp.float32(-ONE / np.float32(5040)))
SINE_9 = wp.constant(wp.float32(ONE / np.float32(362880)))
COSINE_4 = wp.constant(wp.float32(ONE / np.float32(24)))
COSINE_6 = wp.constant(wp.float32(-ONE / np.float32(720)))
COSINE_8 = wp.constant(wp.float32(ONE / np.float32(40320)))
GRAY_ALBEDO = wp.constant(wp.float32(0.6))
UNIT_STEP = wp.constant(wp.float32(2.0**-24))
LEAVE = wp.constant(wp.float32(2.0**-18))


@wp.struct
class Frame:
    """The camera's vectors, the picture's size, and the part of the picture that one pass renders."""

    eye: wp.vec3
    centre: wp.vec3
    right: wp.vec3
    up: wp.vec3
    width: wp.int32
    height: wp.int32
    band_row: wp.int32  # the row of the first sum
    first_row: wp.int32
    first_column: wp.int32
    columns: wp.int32
    first_sample: wp.int32
    samples: wp.int32  # per pixel in this pass
    seed: wp.uint32


@wp.func
def _mixed(v: wp.vec4ui) -> wp.vec4ui:
    x = v[0] + v[1] * v[3]
    y = v[1] + v[2] * x
    z = v[2] + x * y
    return wp.vec4ui(x, y, z, v[3] + y * z)


@wp.func
def _pcg4d(x: wp.uint32, y: wp.uint32, z: wp.uint32, w: wp.uint32) -> wp.vec4ui:
    a = wp.uint32(1664525)
    c = wp.uint32(1013904223)
    v = _mixed(wp.vec4ui(x * a + c, y * a + c, z * a + c, w * a + c))
    s = wp.uint32(16)
    return _mixed(wp.vec4ui(v[0] ^ (v[0] >> s), v[1] ^ (v[1] >> s), v[2] ^ (v[2] >> s), v[3] ^ (v[3] >> s)))


@wp.func
def _to_unit(bits: wp.uint32) -> wp.float32:
    return wp.float32(bits >> wp.uint32(8)) * UNIT_STEP


@wp.func
def _dot(a: wp.vec3, b: wp.vec3) -> wp.float32:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@wp.func
def _unit(a: wp.vec3) -> wp.vec3:
    return a * (1.0 / wp.sqrt(_dot(a, a)))


@wp.func
def _in_double(a: wp.vec3) -> wp.vec3d:
    return wp.vec3d(wp.float64(a[0]), wp.float64(a[1]), wp.float64(a[2]))


@wp.func
def _unit_normal(a: wp.vec3, b: wp.vec3, c: wp.vec3) -> wp.vec3:
    """The unit normal, computed in double: in float, tiny and huge triangles would lose it."""
    u = _in_double(b) - _in_double(a)
    v = _in_double(c) - _in_double(a)
    x = u[1] * v[2] - u[2] * v[1]
    y = u[2] * v[0] - u[0] * v[2]
    z = u[0] * v[1] - u[1] * v[0]
    scale = wp.float64(1.0) / wp.sqrt(x * x + y * y + z * z)
    return wp.vec3(wp.float32(x * scale), wp.float32(y * scale), wp.float32(z * scale))


@wp.func
def _largest_component(a: wp.vec3) -> wp.float32:
    return wp.max(wp.max(wp.abs(a[0]), wp.abs(a[1])), wp.abs(a[2]))


@wp.func
def _cosine_direction(n: wp.vec3, random_a: wp.float32, random_b: wp.float32) -> wp.vec3:
    """Cosine-distributed about the unit normal n: Shirley and Chiu's disk lifted to the hemisphere."""
    a = 2.0 * random_a - 1.0
    b = 2.0 * random_b - 1.0
    along_a = wp.abs(a) > wp.abs(b)
    radius = wp.where(along_a, a, b)
    other = wp.where(along_a, b, a)
    sine = wp.float32(0.0)
    cosine = wp.float32(1.0)
    if radius != 0.0:
        angle = QUARTER_PI * (other / radius)
        s = angle * angle
        sine = angle * (1.0 + s * (SINE_3 + s * (SINE_5 + s * (SINE_7 + s * SINE_9))))
        cosine = 1.0 + s * (-0.5 + s * (COSINE_4 + s * (COSINE_6 + s * COSINE_8)))
    x = radius * wp.where(along_a, cosine, sine)
    y = radius * wp.where(along_a, sine, cosine)
    z = wp.sqrt(wp.max(0.0, 1.0 - x * x - y * y))
    # Duff et al. 2017, "Building an Orthonormal Basis, Revisited"; 1/-0 is negative, as the sign of -0 is.
    sign = wp.where(n[2] < 0.0 or (n[2] == 0.0 and 1.0 / n[2] < 0.0), -1.0, 1.0)
    p = -1.0 / (sign + n[2])
    q = n[0] * n[1] * p
    tangent = wp.vec3(1.0 + sign * n[0] * n[0] * p, sign * q, -sign * n[0])
    bitangent = wp.vec3(q, sign + n[1] * n[1] * p, -n[1])
    return tangent * x + bitangent * y + n * z


@wp.func
def _pixel_index(frame: Frame, path: wp.int32) -> wp.uint32:
    """The pixel's number in the whole picture."""
    pixel = path // frame.samples
    row = frame.first_row + pixel // frame.columns
    return wp.uint32(row) * wp.uint32(frame.width) + wp.uint32(frame.first_column + pixel % frame.columns)


@wp.kernel
def start_paths(
    frame: Frame,
    path: wp.array[wp.int32],
    throughput: wp.array[wp.vec3],
    last_bounce: wp.array[wp.int32],
    origins: wp.array[wp.vec3],
    directions: wp.array[wp.vec3],
) -> None:
    """Write one camera ray per path: all samples of a pixel, then those of the next pixel."""
    i = wp.tid()
    pixel = i // frame.samples
    row = frame.first_row + pixel // frame.columns
    column = frame.first_column + pixel % frame.columns
    sample = wp.uint32(frame.first_sample + i % frame.samples)
    random = _pcg4d(_pixel_index(frame, i), sample, wp.uint32(0), frame.seed)
    x = wp.float32(column) + _to_unit(random[0])
    y = wp.float32(row) + _to_unit(random[1])
    across = 2.0 * x / wp.float32(frame.width) - 1.0
    upward = 1.0 - 2.0 * y / wp.float32(frame.height)
    path[i] = i
    throughput[i] = wp.vec3(1.0, 1.0, 1.0)
    last_bounce[i] = -1
    origins[i] = frame.eye
    directions[i] = _unit(frame.centre + frame.right * across + frame.up * upward)


@wp.kernel
def shade(
    frame: Frame,
    bounce: wp.int32,
    bounces: wp.int32,
    coloured: wp.bool,
    vertices: wp.array[wp.vec3],
    faces: wp.array[wp.vec3i],
    prim: wp.array[wp.int32],
    uv: wp.array[wp.vec2],
    path: wp.array[wp.int32],
    directions: wp.array[wp.vec3],
    throughput: wp.array[wp.vec3],
    last_bounce: wp.array[wp.int32],
    alive: wp.array[wp.int32],
    next_path: wp.array[wp.int32],
    next_origins: wp.array[wp.vec3],
    next_directions: wp.array[wp.vec3],
) -> None:
    """Mark paths that escape with their bounce; the others bounce, at most `bounces` times."""
    i = wp.tid()
    own = path[i]
    face = vertices_of(faces, prim[i], vertices.shape[0])
    if face[0] < 0:
        last_bounce[own] = bounce
        return
    if bounce == bounces:
        return
    a = vertices[face[0]]
    b = vertices[face[1]]
    c = vertices[face[2]]
    normal = _unit_normal(a, b, c)
    if coloured:
        colour = normal * 0.5 + wp.vec3(0.5, 0.5, 0.5)
        throughput[own] = wp.cw_mul(throughput[own], colour)
    else:
        throughput[own] = throughput[own] * GRAY_ALBEDO
    u = uv[i][0]
    v = uv[i][1]
    point = a * (1.0 - u - v) + b * u + c * v
    facing = wp.where(_dot(normal, directions[i]) > 0.0, normal * -1.0, normal)
    sample = wp.uint32(frame.first_sample + own % frame.samples)
    random = _pcg4d(_pixel_index(frame, own), sample, wp.uint32(bounce + 1), frame.seed)
    slot = wp.atomic_add(alive, 0, 1)
    next_path[slot] = own
    # Off the surface by more than the point's own rounding error.
    next_origins[slot] = point + facing * (LEAVE * wp.max(_largest_component(point), _largest_component(a)))
    next_directions[slot] = _cosine_direction(facing, _to_unit(random[0]), _to_unit(random[1]))


@wp.kernel
def accumulate(
    frame: Frame,
    depth: wp.int32,
    throughput: wp.array[wp.vec3],
    last_bounce: wp.array[wp.int32],
    sums: wp.array[wp.vec3],
) -> None:
    """Add the sky's light along a pixel's escaped paths, by bounce and sample as render.cpp does."""
    i = wp.tid()
    row = frame.first_row - frame.band_row + i // frame.columns
    pixel = row * frame.width + frame.first_column + i % frame.columns
    total = sums[pixel]
    for bounce in range(depth):
        for sample in range(frame.samples):
            own = i * frame.samples + sample
            if last_bounce[own] == bounce:
                total = total + throughput[own]
    sums[pixel] = total
