"""The caller's floating-point environment changes no result, and is as it was afterwards."""

import platform
import subprocess
import sys
from pathlib import Path

import pytest

# What libraries do to the processor's settings: rounding directions by the C library; flushing to zero and
# unmasked exceptions by MXCSR, which fegetenv and fesetenv store and load.
SETUP = """
import ctypes, ctypes.util, sys
import numpy as np
import wive

libm = ctypes.CDLL(ctypes.util.find_library("m"))
MXCSR = 28  # its offset in glibc's fenv_t on x86-64

def mxcsr(flags=None):
    state = ctypes.create_string_buffer(64)
    assert libm.fegetenv(state) == 0
    word = ctypes.c_uint32.from_buffer(state, MXCSR)
    if flags is not None:
        word.value = 0x1f80 | flags if flags >= 0 else 0x1f80 & ~-flags
        assert libm.fesetenv(state) == 0
    return word.value & 0xffc0

ENVIRONMENTS = {"down": 0x2000, "up": 0x4000, "toward zero": 0x6000, "flushed to zero": 0x8040,
                "trapping": -0x0680}

random = np.random.default_rng(1)
corners = random.random((150, 1, 3)) + 0.3 * random.standard_normal((150, 3, 3))
faces = np.arange(450, dtype=np.int32).reshape(-1, 3)
o, d = random.standard_normal((2, 600, 3))
camera = wive.Camera((0.5, 0.5, -2), (0.5, 0.5, 0.5))
backends = sys.argv[1:]

def inputs(dtype, scale):
    huge = np.float32(1e30) if dtype == np.float32 else 1e300
    directions = d.astype(dtype)
    v = (corners.reshape(-1, 3) * scale).astype(dtype)
    return v, v[::-1].copy(), (o * scale).astype(dtype), directions, directions * huge, o * scale

def answers(dtype, scale, accuracy, backend, nodes, given):
    v, moved, origins, directions, long_directions, as_doubles = given
    def trace():
        scene = wive.Scene(v, faces, accuracy=accuracy, backend=backend, nodes=nodes, quality="high")
        for refitted in (False, True):
            hits = scene.intersect(origins, directions, -np.inf)
            yield hits.t, hits.prim, hits.uv, scene.bounds
            yield hits.points(), hits.normals(), np.asarray(hits.error_bound), hits.spawn(directions)
            yield scene.occluded(origins, directions), scene.count(origins, long_directions)
            every = scene.intersect_all(origins[:100], directions[:100])
            yield every.offsets, every.t, every.prim, every.uv
            yield scene.intersect(origins[:5], directions[:5], in_flight=1).t if backend != "warp" else 0,
            scene.refit(moved)
        yield scene.intersect(as_doubles, d).t,
        if dtype == np.float32 and scale == 1:
            yield wive.render(scene, camera, width=16, height=16, spp=1),
    return [np.asarray(array) for group in trace() for array in group]
"""

SAME = (
    SETUP
    + """
CASES = [(np.float32, 1, "watertight", "float32"), (np.float32, 1e-38, "watertight", "compressed"),
         (np.float32, 1e-38, "exact", "float32"), (np.float64, 1e-300, "fast", "float32"),
         (np.float64, 1, "watertight", "compressed")]
for backend in backends:
    for dtype, scale, accuracy, nodes in CASES:
        if backend == "warp" and (dtype, accuracy) == (np.float64, "fast"):
            accuracy = "watertight"  # whose kernels other tests compile as well
        case = dtype, scale, accuracy, backend, nodes, inputs(dtype, scale)
        usual = answers(*case)
        for name, flags in ENVIRONMENTS.items():
            if name == "trapping" and (backend == "warp" or scale != 1):
                continue  # NumPy's own conversions would trap
            mxcsr(flags)
            set_so = mxcsr()
            try:
                found = answers(*case)
                kept = mxcsr() == set_so
            finally:
                mxcsr(0)
            assert kept, (backend, name)
            for i, (one, other) in enumerate(zip(found, usual, strict=True)):
                assert one.tobytes() == other.tobytes(), (backend, name, dtype, scale, accuracy, nodes, i)
"""
)

needs_mxcsr = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="sets MXCSR by glibc's fesetenv"
)


@needs_mxcsr
def test_results_do_not_depend_on_the_callers_floating_point_environment(
    backend: str, tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SAME, backend], capture_output=True, text=True, timeout=300, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr[-2000:]
