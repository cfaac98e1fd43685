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
SUN_RADIUS = wp.constant(wp.float32(0.02))
GRAY, NORMALS, OF_FACES, OF_VERTICES = (wp.constant(wp.int32(i)) for i in range(4))


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
    albedo: wp.int32
    sky_up: wp.vec3
    horizon: wp.vec3
    zenith: wp.vec3
    to_sun: wp.vec3
    sun: wp.vec3
    has_sun: wp.bool


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
def _on_disk(random_a: wp.float32, random_b: wp.float32) -> wp.vec2:
    """A uniformly distributed point of the unit disk: Shirley and Chiu's concentric map."""
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
    return wp.vec2(radius * wp.where(along_a, cosine, sine), radius * wp.where(along_a, sine, cosine))


@wp.func
def _across(n: wp.vec3, x: wp.float32, y: wp.float32) -> wp.vec3:
    """x along a tangent of the unit vector n, y along its bitangent: Duff et al. 2017."""
    # 1/-0 is negative, as the sign of -0 is.
    sign = wp.where(n[2] < 0.0 or (n[2] == 0.0 and 1.0 / n[2] < 0.0), -1.0, 1.0)
    p = -1.0 / (sign + n[2])
    q = n[0] * n[1] * p
    tangent = wp.vec3(1.0 + sign * n[0] * n[0] * p, sign * q, -sign * n[0])
    bitangent = wp.vec3(q, sign + n[1] * n[1] * p, -n[1])
    return tangent * x + bitangent * y


@wp.func
def _cosine_direction(n: wp.vec3, random_a: wp.float32, random_b: wp.float32) -> wp.vec3:
    """Cosine-distributed about the unit normal n: a point of the disk, projected to the hemisphere."""
    place = _on_disk(random_a, random_b)
    z = wp.sqrt(wp.max(0.0, 1.0 - place[0] * place[0] - place[1] * place[1]))
    return _across(n, place[0], place[1]) + n * z


@wp.func
def _toward_sun(frame: Frame, random_a: wp.float32, random_b: wp.float32) -> wp.vec3:
    """A direction to somewhere on the sun, of about length 1."""
    place = _on_disk(random_a, random_b)
    return frame.to_sun + _across(frame.to_sun, place[0] * SUN_RADIUS, place[1] * SUN_RADIUS)


@wp.func
def _sky(frame: Frame, direction: wp.vec3) -> wp.vec3:
    """The sky's radiance along a unit direction."""
    height = wp.sqrt(wp.min(1.0, wp.max(0.0, _dot(frame.sky_up, direction))))
    return frame.horizon + (frame.zenith - frame.horizon) * height


@wp.func
def _weighted(a: wp.vec3, b: wp.vec3, c: wp.vec3, uv: wp.vec2) -> wp.vec3:
    """The value at uv of a triangle with these values at its corners."""
    return a * (1.0 - uv[0] - uv[1]) + b * uv[0] + c * uv[1]


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
    light: wp.array[wp.vec3],
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
    light[i] = wp.vec3(0.0, 0.0, 0.0)
    origins[i] = frame.eye
    directions[i] = _unit(frame.centre + frame.right * across + frame.up * upward)


@wp.kernel
def shade(
    frame: Frame,
    bounce: wp.int32,
    bounces: wp.int32,
    vertices: wp.array[wp.vec3],
    faces: wp.array[wp.vec3i],
    colours: wp.array[wp.vec3],
    prim: wp.array[wp.int32],
    uv: wp.array[wp.vec2],
    path: wp.array[wp.int32],
    directions: wp.array[wp.vec3],
    throughput: wp.array[wp.vec3],
    light: wp.array[wp.vec3],
    counts: wp.array[wp.int32],  # of paths that bounce, and of rays towards the sun
    next_path: wp.array[wp.int32],
    next_origins: wp.array[wp.vec3],
    next_directions: wp.array[wp.vec3],
    sun_path: wp.array[wp.int32],
    sun_origins: wp.array[wp.vec3],
    sun_directions: wp.array[wp.vec3],
    sun_light: wp.array[wp.vec3],
) -> None:
    """Add the sky's light to paths that escape; the others bounce, at most `bounces` times.

    Those that bounce may have a ray towards the sun.
    """
    i = wp.tid()
    own = path[i]
    face = vertices_of(faces, prim[i], vertices.shape[0])
    if face[0] < 0:
        light[own] = light[own] + wp.cw_mul(throughput[own], _sky(frame, directions[i]))
        return
    if bounce == bounces:
        return
    a = vertices[face[0]]
    b = vertices[face[1]]
    c = vertices[face[2]]
    normal = _unit_normal(a, b, c)
    passed = throughput[own]
    if frame.albedo == GRAY:
        passed = passed * GRAY_ALBEDO
    elif frame.albedo == NORMALS:
        passed = wp.cw_mul(passed, normal * 0.5 + wp.vec3(0.5, 0.5, 0.5))
    elif frame.albedo == OF_FACES:
        passed = wp.cw_mul(passed, colours[prim[i]])
    else:
        passed = wp.cw_mul(passed, _weighted(colours[face[0]], colours[face[1]], colours[face[2]], uv[i]))
    throughput[own] = passed
    point = _weighted(a, b, c, uv[i])
    facing = wp.where(_dot(normal, directions[i]) > 0.0, normal * -1.0, normal)
    sample = wp.uint32(frame.first_sample + own % frame.samples)
    random = _pcg4d(_pixel_index(frame, own), sample, wp.uint32(bounce + 1), frame.seed)
    # Off the surface by more than the point's own rounding error.
    origin = point + facing * (LEAVE * wp.max(_largest_component(point), _largest_component(a)))
    slot = wp.atomic_add(counts, 0, 1)
    next_path[slot] = own
    next_origins[slot] = origin
    next_directions[slot] = _cosine_direction(facing, _to_unit(random[0]), _to_unit(random[1]))
    cosine = _dot(facing, frame.to_sun)
    if frame.has_sun and cosine > 0.0:
        ray = wp.atomic_add(counts, 1, 1)
        sun_path[ray] = own
        sun_origins[ray] = origin
        sun_directions[ray] = _toward_sun(frame, _to_unit(random[2]), _to_unit(random[3]))
        sun_light[ray] = wp.cw_mul(passed, frame.sun) * cosine


@wp.kernel
def add_sun(
    path: wp.array[wp.int32],
    sun_light: wp.array[wp.vec3],
    shadowed: wp.array[wp.bool],
    light: wp.array[wp.vec3],
) -> None:
    """Add the sun's light to paths whose rays towards it are free; a path has one such ray at most."""
    i = wp.tid()
    if not shadowed[i]:
        light[path[i]] = light[path[i]] + sun_light[i]


@wp.kernel
def accumulate(frame: Frame, light: wp.array[wp.vec3], sums: wp.array[wp.vec3]) -> None:
    """Add the light of a pixel's paths, sample by sample."""
    i = wp.tid()
    row = frame.first_row - frame.band_row + i // frame.columns
    pixel = row * frame.width + frame.first_column + i % frame.columns
    total = sums[pixel]
    for sample in range(frame.samples):
        total = total + light[i * frame.samples + sample]
    sums[pixel] = total
