"""The libraries whose arrays queries take and return: NumPy, Warp, PyTorch, and all that support DLPack.

Each class converts one library's arrays to NumPy or to Warp and back, sharing memory. No library is imported
here: if there is an array of it, it has been imported already.
"""

import contextlib
import sys
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

# Device types of DLPack, https://dmlc.github.io/dlpack/latest/c_api.html
DLPACK_CPU = (1, 3)  # host memory, and host memory pinned for CUDA
DLPACK_CUDA = (2, 13)  # device memory, and memory managed by CUDA

NDArrayAny = NDArray[Any]


class Library(Protocol):
    """One library's arrays. Conversions share memory if they can, and copy if not."""

    name: str

    def device(self, array: Any) -> str | None:
        """The array's device, by Warp's names; None if the library doesn't tell."""

    def to_numpy(self, array: Any) -> NDArrayAny:
        """The library's array in host memory as a NumPy array."""

    def from_numpy(self, array: NDArrayAny) -> Any:
        """A NumPy array as the library's."""

    def to_warp(self, array: Any, device: str) -> Any:
        """The library's array on `device` as a Warp array, ordered behind the stream that writes it."""

    def from_warp(self, array: Any) -> Any:
        """A Warp array as the library's, ordered before the stream that reads it."""

    def on_stream(self, device: str) -> contextlib.AbstractContextManager[Any]:
        """A block whose Warp launches and allocations use the library's current stream, if it has streams."""


class _OnWarpStream:
    def on_stream(self, device: str) -> contextlib.AbstractContextManager[Any]:
        """Warp's own stream."""
        return contextlib.nullcontext()


class NumPyArrays(_OnWarpStream):
    """NumPy's arrays, and the lists and numbers that NumPy converts."""

    name = "NumPy"

    def device(self, array: Any) -> str | None:
        """Host memory."""
        return "cpu"

    def to_numpy(self, array: Any) -> Any:
        """The array itself: `wive._internal.arguments` converts it."""
        return array

    def from_numpy(self, array: NDArrayAny) -> Any:
        """The array itself."""
        return array

    def to_warp(self, array: Any, device: str) -> Any:
        """An array on the device: a copy, unless the device is the host."""
        import warp as wp

        return wp.array(array, device=device, copy=False)

    def from_warp(self, array: Any) -> Any:
        """An array on the host: a copy, unless the device is the host."""
        return array.numpy()


class WarpArrays(_OnWarpStream):
    """Warp's arrays. `vectors`: rays were given as vec3, so that pairs of floats are returned as vec2."""

    name = "Warp"

    def __init__(self, vectors: bool) -> None:
        """Make arrays of vec2, or of float with two columns."""
        self.vectors = vectors

    def device(self, array: Any) -> str | None:
        """The array's device."""
        return str(array.device.alias)

    def to_numpy(self, array: Any) -> NDArrayAny:
        """A view with one row per vec3."""
        found: NDArrayAny = array.numpy()
        return found

    def from_numpy(self, array: NDArrayAny) -> Any:
        """An array on Warp's CPU device."""
        import warp as wp

        vectors = {
            (2, "float32"): wp.vec2, (3, "float32"): wp.vec3,
            (2, "float64"): wp.vec2d, (3, "float64"): wp.vec3d,
        }  # fmt: skip
        rows = (array.shape[1], array.dtype.name) if array.ndim == 2 and self.vectors else None
        dtype = {"dtype": vectors[rows]} if rows in vectors else {}
        return wp.array(array, device="cpu", copy=False, **dtype)

    def to_warp(self, array: Any, device: str) -> Any:
        """The array itself; a copy of the rows that an indexed array chooses."""
        import warp as wp

        return array if isinstance(array, wp.array) else array.contiguous()

    def from_warp(self, array: Any) -> Any:
        """The array itself, or its vectors as rows of two or three numbers."""
        return array if self.vectors else _rows(array)


class TorchTensors:
    """PyTorch's tensors; queries carry no gradient to them."""

    name = "torch"

    def device(self, array: Any) -> str | None:
        """The tensor's device."""
        index = array.device.index
        return str(array.device.type) if array.device.type == "cpu" else f"{array.device.type}:{index or 0}"

    def to_numpy(self, array: Any) -> NDArrayAny:
        """A view of the tensor's memory."""
        found: NDArrayAny = array.detach().numpy()
        return found

    def from_numpy(self, array: NDArrayAny) -> Any:
        """A tensor over the same memory."""
        return sys.modules["torch"].from_numpy(array)

    def to_warp(self, array: Any, device: str) -> Any:
        """An array over the same memory."""
        import warp as wp

        return wp.from_torch(array.detach())

    def from_warp(self, array: Any) -> Any:
        """A tensor over the same memory."""
        import warp as wp

        return wp.to_torch(array)

    def on_stream(self, device: str) -> contextlib.AbstractContextManager[Any]:
        """PyTorch's current stream, so that no stream has to wait for another."""
        if device == "cpu":
            return contextlib.nullcontext()
        import warp as wp

        current = wp.stream_from_torch(sys.modules["torch"].cuda.current_stream(device))
        # Warp frees memory on its own stream, which has to go on behind this one. Graphs can't capture that.
        stream: contextlib.AbstractContextManager[Any] = wp.ScopedStream(
            current, sync_enter=False, sync_exit=not current.is_capturing
        )
        return stream


class DLPackArrays(_OnWarpStream):
    """Arrays that support DLPack, such as CuPy's and JAX's; the protocol orders the streams."""

    def __init__(self, name: str, namespace: Any) -> None:
        """`namespace` is the module whose `from_dlpack` makes such arrays; else results are NumPy's."""
        self.name = name
        self.make = getattr(namespace, "from_dlpack", None)

    def device(self, array: Any) -> str | None:
        """The device that the protocol names."""
        kind, index = array.__dlpack_device__()
        kind = getattr(kind, "value", kind)  # Open3D's is an enum of its own
        if kind in DLPACK_CPU:
            return "cpu"
        return f"cuda:{index}" if kind in DLPACK_CUDA else f"DLPack device {int(kind)}"

    def to_numpy(self, array: Any) -> NDArrayAny:
        """A read-only view."""
        return np.from_dlpack(array)

    def from_numpy(self, array: NDArrayAny) -> Any:
        """An array over the same memory, or over a copy if it is read-only and NumPy is older than 2.1."""
        if self.make is None:
            return array
        try:
            return self.make(array)
        except BufferError:
            return self.make(array.copy())

    def to_warp(self, array: Any, device: str) -> Any:
        """An array over the same memory."""
        import warp as wp

        return wp.from_dlpack(array)

    def from_warp(self, array: Any) -> Any:
        """An array over the same memory; NumPy's are a copy, unless the device is the host."""
        return array.numpy() if self.make is None else self.make(array)


class CudaInterfaceArrays(_OnWarpStream):
    """Arrays that have only `__cuda_array_interface__`. Results are Warp arrays, which have it as well."""

    name = "__cuda_array_interface__"

    def device(self, array: Any) -> str | None:
        """None: the interface doesn't tell."""
        return None

    def to_numpy(self, array: Any) -> NDArrayAny:
        """TypeError: no such array is in host memory."""
        raise TypeError("an array with __cuda_array_interface__ is not in host memory")

    def from_numpy(self, array: NDArrayAny) -> Any:
        """TypeError: no such array is in host memory."""
        raise TypeError("an array with __cuda_array_interface__ is not in host memory")

    def to_warp(self, array: Any, device: str) -> Any:
        """An array over the same memory, ordered behind the stream that the interface names."""
        import warp as wp

        sized = _SizedInterface(array)
        stream = sized.__cuda_array_interface__.get("stream")
        if stream is not None:
            wp.get_stream(device).wait_stream(wp.Stream(device, cuda_stream=stream))
        return wp.array(data=sized, device=device, copy=False)

    def from_warp(self, array: Any) -> Any:
        """The Warp array, with vectors as rows."""
        return _rows(array)


class _SizedInterface:
    """An array's `__cuda_array_interface__` with a length: Warp refuses objects that have none."""

    def __init__(self, array: Any) -> None:
        self._array = array  # lives as long as the Warp array over its memory
        self.__cuda_array_interface__: dict[str, Any] = array.__cuda_array_interface__

    def __len__(self) -> int:
        return int(self.__cuda_array_interface__["shape"][0])


NUMPY = NumPyArrays()
WARP_VECTORS, WARP_NUMBERS = WarpArrays(vectors=True), WarpArrays(vectors=False)
TORCH = TorchTensors()
CUDA_INTERFACE = CudaInterfaceArrays()
# A quick test for these types avoids the library lookup, which matters for one-ray queries.
NUMPY_TYPES = (np.ndarray, float, int, list, tuple, np.generic)


def library_of(value: Any) -> Library:
    """The library that `value` is an array of; NumPy for values of no known library."""
    if isinstance(value, NUMPY_TYPES):
        return NUMPY
    torch, warp = sys.modules.get("torch"), sys.modules.get("warp")
    if warp is not None and isinstance(value, (warp.array, warp.indexedarray)):
        return WARP_VECTORS if value.dtype in (warp.vec3, warp.vec3d) else WARP_NUMBERS
    if torch is not None and isinstance(value, torch.Tensor):
        return TORCH
    if hasattr(value, "__dlpack__"):
        return _dlpack_library(value)
    if hasattr(value, "__cuda_array_interface__"):
        return CUDA_INTERFACE
    return NUMPY


def lies_on(place: str | None, device: str) -> bool:
    """Whether an array at `place` may be on `device`; None (its library doesn't tell) is a CUDA device."""
    return device != "cpu" if place is None else place == device


def _dlpack_library(value: Any) -> Library:
    """By the module of the array API that made `value`, or the package that its type comes from."""
    package = type(value).__module__.partition(".")[0]
    if not hasattr(value, "__array_namespace__"):
        return DLPackArrays(package, sys.modules.get(package))
    namespace = value.__array_namespace__()
    return DLPackArrays(str(namespace.__name__).partition(".")[0], namespace)


def _rows(array: Any) -> Any:
    """A Warp array of vectors as one of numbers with columns, over the same memory."""
    import warp as wp

    length = getattr(array.dtype, "_length_", 1)
    if length == 1:
        return array
    scalar = array.dtype._wp_scalar_type_
    rows = wp.array(ptr=array.ptr, dtype=scalar, shape=(len(array), length), device=array.device, copy=False)
    rows._owner = array
    return rows
