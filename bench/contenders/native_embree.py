"""Embree 4 called natively on NumPy arrays, one ray at a time or in packets."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import BenchError, open_shim

Isa = Literal["sse2", "avx", "avx2", "avx512"]
Quality = Literal["low", "medium", "high"]
Width = Literal[1, 8, 16]  # rays per call
QUALITIES: dict[Quality, int] = {"low": 0, "medium": 1, "high": 2}  # enum RTCBuildQuality

NATIVE_RAY8, NATIVE_RAY16 = 33, 34  # enum RTCDeviceProperty: supported from AVX and from AVX-512 on
VERSION_PARTS = (1, 2, 3)

Pointer = ctypes.c_void_p


class _Rays(ctypes.Structure):
    """Mirror of `Rays` in embree_shim.cpp."""

    _fields_ = (
        ("count", ctypes.c_size_t),
        ("origins", Pointer),
        ("directions", Pointer),
        ("tmin", Pointer),
        ("tmax", Pointer),
        ("tmin_step", ctypes.c_size_t),
        ("tmax_step", ctypes.c_size_t),
    )


@cache
def _shim() -> ctypes.CDLL:
    shim = open_shim()
    shim.shim_create.restype = Pointer
    shim.shim_create.argtypes = [
        ctypes.c_char_p, Pointer, ctypes.c_size_t, Pointer, ctypes.c_size_t, ctypes.c_int, ctypes.c_int,
    ]  # fmt: skip
    shim.shim_commit.restype = ctypes.c_double
    shim.shim_commit.argtypes = [Pointer]
    shim.shim_release.restype = None
    shim.shim_release.argtypes = [Pointer]
    shim.shim_bytes.restype = ctypes.c_ssize_t
    shim.shim_bytes.argtypes = [Pointer]
    shim.shim_property.restype = ctypes.c_ssize_t
    shim.shim_property.argtypes = [Pointer, ctypes.c_int]
    shim.shim_flush_denormals.restype = ctypes.c_uint
    shim.shim_flush_denormals.argtypes = [ctypes.c_int]
    shim.shim_trim_heap.restype = None
    shim.shim_trim_heap.argtypes = []
    shim.shim_restore_control.restype = None
    shim.shim_restore_control.argtypes = [ctypes.c_uint]
    shim.shim_intersect.restype = None
    shim.shim_intersect.argtypes = [
        Pointer, ctypes.POINTER(_Rays), ctypes.c_uint, Pointer, Pointer, Pointer,
    ]  # fmt: skip
    shim.shim_occluded.restype = None
    shim.shim_occluded.argtypes = [Pointer, ctypes.POINTER(_Rays), Pointer]
    return shim


@contextmanager
def flushed_denormals(enabled: bool) -> Iterator[None]:
    """Makes the calling thread flush denormals to zero, or keep them, inside the block."""
    before = _shim().shim_flush_denormals(int(enabled))
    try:
        yield
    finally:
        _shim().shim_restore_control(before)


def trim_heap() -> None:
    """Gives freed memory back to the system, so that a build reuses no pages of an earlier build."""
    _shim().shim_trim_heap()


class EmbreeMesh:
    """One mesh in an Embree device of its own; `commit` builds the tree.

    vertices (v,3) float32 and faces (f,3) int32 are C-contiguous. `robust` sets Embree's robust flag; `isa`,
    `threads` and `verbose` go into the device's configuration. An instruction set that this machine lacks
    raises BenchError.
    """

    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.int32],
        *,
        isa: Isa = "avx512",
        robust: bool = False,
        threads: int = 1,
        quality: Quality = "medium",
        verbose: int = 0,
    ) -> None:
        """Hands the mesh to a new device and builds nothing yet."""
        self._mesh: int | None = None
        config = f"threads={threads},isa={isa},verbose={verbose}"
        self._mesh = _shim().shim_create(
            config.encode(), _address(vertices, np.float32), len(vertices),
            _address(faces, np.int32), len(faces), int(robust), QUALITIES[quality],
        )  # fmt: skip
        if not self._mesh:
            raise BenchError(f"Embree refuses the device configuration {config!r} on this machine")
        wide = {"sse2": (0, 0), "avx": (1, 0), "avx2": (1, 0), "avx512": (1, 1)}[isa]
        if (self._property(NATIVE_RAY8), self._property(NATIVE_RAY16)) != wide:
            raise BenchError(f"Embree does not follow isa={isa}")

    def __enter__(self) -> "EmbreeMesh":
        """Itself; leaving the block frees it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Frees tree and device."""
        self.release()

    def release(self) -> None:
        """Frees tree and device."""
        if self._mesh:
            _shim().shim_release(self._mesh)
        self._mesh = None

    def _property(self, number: int) -> int:
        return int(_shim().shim_property(self._mesh, number))

    @property
    def version(self) -> str:
        """Embree's version, as "4.4.0"."""
        return ".".join(str(self._property(part)) for part in VERSION_PARTS)

    @property
    def memory(self) -> int:
        """Bytes that Embree has allocated for this mesh; it shares vertices and faces."""
        return int(_shim().shim_bytes(self._mesh))

    def commit(self) -> float:
        """Builds the tree; returns the seconds that rtcCommitScene took."""
        seconds = float(_shim().shim_commit(self._mesh))
        if seconds < 0:
            raise BenchError("Embree reports an error while building")
        return seconds

    def intersect(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        tmin: NDArray[np.float32],
        tmax: NDArray[np.float32],
        width: Width = 1,
    ) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32]]:
        """Closest hits by rtcIntersect1, 8 or 16: t (n,), prim (n,), uv (n,2).

        t is tmax and prim -1 on a miss. Packets have Embree's flag for coherent rays.
        """
        rays = _rays(origins, directions, tmin, tmax)
        t = np.empty(rays.count, np.float32)
        prim = np.empty(rays.count, np.int32)
        uv = np.empty((rays.count, 2), np.float32)
        _shim().shim_intersect(self._mesh, rays, width, t.ctypes.data, prim.ctypes.data, uv.ctypes.data)
        return t, prim, uv

    @property
    def tracer(self) -> tuple[int, int]:
        """Closest hits for `_cpu.Bvh.render_rows`: the addresses of a function and of its context."""
        address = ctypes.cast(_shim().shim_trace, Pointer).value
        assert address and self._mesh
        return address, self._mesh

    def occluded(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        tmin: NDArray[np.float32],
        tmax: NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """Whether each ray hits anything, by rtcOccluded1: (n,) bool."""
        rays = _rays(origins, directions, tmin, tmax)
        result = np.empty(rays.count, np.bool_)
        _shim().shim_occluded(self._mesh, rays, result.ctypes.data)
        return result


def _address(array: NDArray[np.generic], dtype: type[np.generic]) -> int:
    if array.dtype != dtype or not array.flags.c_contiguous:
        raise TypeError(f"expected a C-contiguous {dtype.__name__} array, got {array.dtype}")
    return array.ctypes.data


def _rays(
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    tmin: NDArray[np.float32],
    tmax: NDArray[np.float32],
) -> _Rays:
    count = len(origins)
    if origins.shape != (count, 3) or directions.shape != (count, 3):
        raise ValueError(f"expected origins and directions (n,3), got {origins.shape} and {directions.shape}")
    if len(tmin) not in (1, count) or len(tmax) not in (1, count):
        raise ValueError(f"expected tmin and tmax of 1 or {count} elements, got {len(tmin)} and {len(tmax)}")
    addresses = [_address(array, np.float32) for array in (origins, directions, tmin, tmax)]
    return _Rays(count, *addresses, int(len(tmin) > 1), int(len(tmax) > 1))
