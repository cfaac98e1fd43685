"""The libraries whose arrays queries take and return: NumPy, Warp, PyTorch, and whatever speaks DLPack.

Each class carries one library's arrays to NumPy or to Warp and back, sharing memory. None of them is imported
here: an array of a library can't come in before somebody has imported it.
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
    """One library's arrays. Nothing copies where memory can be shared."""

    name: str

    def device(self, array: Any) -> str | None:
        """Where the array lies, by Warp's names; None where it does not say."""

    def to_numpy(self, array: Any) -> NDArrayAny:
        """An array in host memory as NumPy's."""

    def from_numpy(self, array: NDArrayAny) -> Any:
        """The way back."""

    def to_warp(self, array: Any, device: str) -> Any:
        """An array on that device as Warp's, once its producer's stream allows."""

    def from_warp(self, array: Any) -> Any:
        """The way back, in the order of the consumer's stream."""

    def on_stream(self, device: str) -> contextlib.AbstractContextManager[Any]:
        """A block whose Warp launches go to the library's current stream; without one, to Warp's own."""


class _OnWarpStream:
    def on_stream(self, device: str) -> contextlib.AbstractContextManager[Any]:
        """Warp's own stream."""
        return contextlib.nullcontext()


class NumPyArrays(_OnWarpStream):
    """NumPy's arrays, and lists and numbers that it makes arrays of."""

    name = "NumPy"

    def device(self, array: Any) -> str | None:
        """Host memory."""
        return "cpu"

    def to_numpy(self, array: Any) -> Any:
        """As it is: conversions are those of `wive._internal.arguments`."""
        return array

    def from_numpy(self, array: NDArrayAny) -> Any:
        """As it is."""
        return array

    def to_warp(self, array: Any, device: str) -> Any:
        """Copied to the device if that is not the host."""
        import warp as wp

        return wp.array(array, device=device, copy=False)

    def from_warp(self, array: Any) -> Any:
        """Copied to the host if it is not there."""
        return array.numpy()


class WarpArrays(_OnWarpStream):
    """Warp's arrays; `vectors` says that pairs of floats come back as vec2, as rays came as vec3."""

    name = "Warp"

    def __init__(self, vectors: bool) -> None:
        """Make arrays of vec2, or of float with two columns."""
        self.vectors = vectors

    def device(self, array: Any) -> str | None:
        """The array's."""
        return str(array.device.alias)

    def to_numpy(self, array: Any) -> NDArrayAny:
        """A view; a vec3 becomes a row."""
        found: NDArrayAny = array.numpy()
        return found

    def from_numpy(self, array: NDArrayAny) -> Any:
        """On Warp's CPU device."""
        import warp as wp

        vectors = {
            (2, "float32"): wp.vec2, (3, "float32"): wp.vec3,
            (2, "float64"): wp.vec2d, (3, "float64"): wp.vec3d,
        }  # fmt: skip
        as_vectors = array.ndim == 2 and self.vectors
        dtype = {"dtype": vectors[array.shape[1], array.dtype.name]} if as_vectors else {}
        return wp.array(array, device="cpu", copy=False, **dtype)

    def to_warp(self, array: Any, device: str) -> Any:
        """As it is."""
        return array

    def from_warp(self, array: Any) -> Any:
        """As it is, or its vectors as rows of two or three."""
        return array if self.vectors else _rows(array)


class TorchTensors:
    """PyTorch's tensors; queries carry no gradient to them."""

    name = "torch"

    def device(self, array: Any) -> str | None:
        """The tensor's."""
        index = array.device.index
        return str(array.device.type) if array.device.type == "cpu" else f"{array.device.type}:{index or 0}"

    def to_numpy(self, array: Any) -> NDArrayAny:
        """A view."""
        found: NDArrayAny = array.detach().numpy()
        return found

    def from_numpy(self, array: NDArrayAny) -> Any:
        """A tensor over the same memory."""
        return sys.modules["torch"].from_numpy(array)

    def to_warp(self, array: Any, device: str) -> Any:
        """Over the same memory."""
        import warp as wp

        return wp.from_torch(array.detach())

    def from_warp(self, array: Any) -> Any:
        """A tensor over the same memory."""
        import warp as wp

        return wp.to_torch(array)

    def on_stream(self, device: str) -> contextlib.AbstractContextManager[Any]:
        """PyTorch's current stream, so that no stream waits for another."""
        if device == "cpu":
            return contextlib.nullcontext()
        import warp as wp

        current = sys.modules["torch"].cuda.current_stream(device)
        stream: contextlib.AbstractContextManager[Any] = wp.ScopedStream(
            wp.stream_from_torch(current), sync_enter=False
        )
        return stream


class DLPackArrays(_OnWarpStream):
    """Arrays that speak DLPack, such as CuPy's and JAX's; the protocol makes streams wait for each other."""

    def __init__(self, namespace: Any) -> None:
        """`namespace` is the module whose `from_dlpack` makes such arrays."""
        self.name = str(namespace.__name__).partition(".")[0]
        self.namespace = namespace

    def device(self, array: Any) -> str | None:
        """As the protocol says."""
        kind, index = array.__dlpack_device__()
        if kind in DLPACK_CPU:
            return "cpu"
        return f"cuda:{index}" if kind in DLPACK_CUDA else f"DLPack device {int(kind)}"

    def to_numpy(self, array: Any) -> NDArrayAny:
        """A view, read-only."""
        return np.from_dlpack(array)

    def from_numpy(self, array: NDArrayAny) -> Any:
        """Over the same memory."""
        return self.namespace.from_dlpack(array)

    def to_warp(self, array: Any, device: str) -> Any:
        """Over the same memory."""
        import warp as wp

        return wp.from_dlpack(array)

    def from_warp(self, array: Any) -> Any:
        """Over the same memory."""
        return self.namespace.from_dlpack(array)


class CudaInterfaceArrays(_OnWarpStream):
    """Arrays known only by `__cuda_array_interface__`: Warp arrays, which have it too, come back."""

    name = "__cuda_array_interface__"

    def device(self, array: Any) -> str | None:
        """The interface does not say."""
        return None

    def to_numpy(self, array: Any) -> NDArrayAny:
        """There is no such array in host memory."""
        raise TypeError("an array with __cuda_array_interface__ is not in host memory")

    def from_numpy(self, array: NDArrayAny) -> Any:
        """There is no such array in host memory."""
        raise TypeError("an array with __cuda_array_interface__ is not in host memory")

    def to_warp(self, array: Any, device: str) -> Any:
        """Over the same memory, once the stream that the interface names has written it."""
        import warp as wp

        stream = array.__cuda_array_interface__.get("stream")
        if stream is not None:
            wp.get_stream(device).wait_stream(wp.Stream(device, cuda_stream=stream))
        return wp.array(data=array, device=device, copy=False)

    def from_warp(self, array: Any) -> Any:
        """Warp's array with vectors as rows."""
        return _rows(array)


NUMPY = NumPyArrays()
WARP_VECTORS, WARP_NUMBERS = WarpArrays(vectors=True), WarpArrays(vectors=False)
TORCH = TorchTensors()
CUDA_INTERFACE = CudaInterfaceArrays()
# Known at a glance, which a call of one ray is glad of.
NUMPY_TYPES = (np.ndarray, float, int, list, tuple, np.generic)


def library_of(value: Any) -> Library:
    """The library that `value` is an array of; NumPy for whatever is left."""
    if isinstance(value, NUMPY_TYPES):
        return NUMPY
    torch, warp = sys.modules.get("torch"), sys.modules.get("warp")
    if warp is not None and isinstance(value, warp.array):
        return WARP_VECTORS if value.dtype in (warp.vec3, warp.vec3d) else WARP_NUMBERS
    if torch is not None and isinstance(value, torch.Tensor):
        return TORCH
    if hasattr(value, "__dlpack__"):
        return DLPackArrays(_namespace(value))
    if hasattr(value, "__cuda_array_interface__"):
        return CUDA_INTERFACE
    return NUMPY


def lies_on(place: str | None, device: str) -> bool:
    """Whether an array at `place` may lie on `device`; None, a place not told, is some CUDA device."""
    return device != "cpu" if place is None else place == device


def host_array(name: str, value: Any) -> Any:
    """`value` as an array that NumPy can read; ValueError where it is not in host memory."""
    library = library_of(value)
    place = library.device(value) or "a CUDA device"
    if place != "cpu":
        raise ValueError(
            f"{name} must be in host memory, where trees are built, got an array on {place}: "
            "copy it to the host"
        )
    return library.to_numpy(value)


def _namespace(value: Any) -> Any:
    """The module of the array API that made `value`, or the package that its type comes from."""
    if hasattr(value, "__array_namespace__"):
        return value.__array_namespace__()
    return sys.modules[type(value).__module__.partition(".")[0]]


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
