"""The renderer with a foreign function as its tracer, as benches use it."""

import ctypes

import numpy as np
import pytest
from support.meshes import sphere

import wive
from wive import _cpu

WIDTH, HEIGHT, SAMPLES, BOUNCES = 48, 32, 4, 3
FUNCTION = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_size_t,
    ctypes.POINTER(ctypes.c_float), ctypes.POINTER(ctypes.c_float), ctypes.c_float, ctypes.c_float,
    ctypes.POINTER(ctypes.c_float), ctypes.POINTER(ctypes.c_int32), ctypes.POINTER(ctypes.c_float),
)  # fmt: skip


@pytest.fixture
def bvh() -> _cpu.Bvh:
    return _cpu.Bvh(*sphere(3))


def rendered(bvh: _cpu.Bvh, **options: object) -> tuple[np.ndarray, int]:
    image = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    frame = wive.Camera(eye=(0, 0, 1.5), target=(0, 0.6, 0), fov=60).frame(WIDTH, HEIGHT)
    rays = bvh.render_rows("scalar", frame, image, 0, HEIGHT, SAMPLES, BOUNCES, "normals", 7, **options)
    return image, rays


def test_a_tracer_that_finds_the_same_hits_renders_the_same_picture(bvh: _cpu.Bvh) -> None:
    contexts = set()

    @FUNCTION
    def trace(context, count, origins, directions, tmin, tmax, t, prim, uv):
        contexts.add(context)
        rays = (np.ctypeslib.as_array(array, (count, 3)) for array in (origins, directions))
        found = bvh.intersect("scalar", *rays, np.float32([tmin]), np.float32([tmax]), threads=1)
        np.ctypeslib.as_array(t, (count,))[:] = found[0]
        np.ctypeslib.as_array(prim, (count,))[:] = found[1]
        np.ctypeslib.as_array(uv, (count, 2))[:] = found[2]

    address = ctypes.cast(trace, ctypes.c_void_p).value
    picture, rays = rendered(bvh)
    other_picture, other_rays = rendered(bvh, tracer=(address, 42))
    assert contexts == {42}
    assert other_rays == rays > WIDTH * HEIGHT * SAMPLES
    np.testing.assert_array_equal(other_picture, picture)


def test_a_picture_does_not_depend_on_the_rays_in_flight(bvh: _cpu.Bvh) -> None:
    (reference, rays), *others = (rendered(bvh, in_flight=in_flight) for in_flight in (0, 1, 3, 64))
    assert 0 < reference.mean() < 1
    for picture, count in others:
        assert count == rays
        np.testing.assert_array_equal(picture, reference)
