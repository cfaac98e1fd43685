"""Warp's devices: which there are, and why the others can't be used.

Warp is imported when its devices are first listed, not before.
"""

import contextlib
import functools
import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from wive._internal.process_lock import process_lock

OLDEST_WARP = (1, 19)
NO_WARP = 'NVIDIA Warp is not installed: pip install "wive[warp]"'
NO_DRIVER = "no NVIDIA driver found: install one, on a machine with an NVIDIA GPU"
SAID_WITHOUT_DRIVER = "Warp CUDA warning: Could not find or load the NVIDIA CUDA driver"
STDERR = 2
NO_GPU = "the NVIDIA driver shows no GPU: look at nvidia-smi and CUDA_VISIBLE_DEVICES"


def warp_problem() -> str:
    """Why Warp can't be used here, and how to mend it; empty if it can."""
    import importlib.metadata  # here, as it doubles the time that `import wive` takes

    if importlib.util.find_spec("warp") is None:
        return NO_WARP
    try:
        version = importlib.metadata.version("warp-lang")
    except importlib.metadata.PackageNotFoundError:
        return "the package `warp` found here is not NVIDIA's: " + NO_WARP.partition(": ")[2]
    if tuple(int(part) for part in version.split(".")[:2]) < OLDEST_WARP:
        oldest = ".".join(map(str, OLDEST_WARP))
        return f'NVIDIA Warp {version} is older than {oldest}: pip install --upgrade "wive[warp]"'
    return ""


_starting = process_lock()  # one thread starts Warp, the others wait


def warp_devices() -> dict[str, str]:
    """Each Warp device by name with the reason it can't be used, empty if it can; "cpu" comes last."""
    with _starting:
        return _found_devices()


@functools.cache
def _found_devices() -> dict[str, str]:
    wp = _start_warp()
    devices = {device.alias: _cuda_problem(wp, device) for device in wp.get_cuda_devices()}
    if not devices:
        devices["cuda:0"] = NO_DRIVER if wp.get_cuda_driver_version() is None else NO_GPU
    return {**devices, "cpu": ""}


def resolve_device(name: str | None) -> str:
    """The usable Warp device meant by `name`; None is the first usable one, "cuda" the first CUDA device.

    Raises ValueError if there is no such device or it can't be used.
    """
    found = warp_devices()
    usable = [device for device, reason in found.items() if not reason]
    if name is None:
        return usable[0]
    canonical = "cuda:0" if name == "cuda" else name
    if canonical in usable:
        return canonical
    if canonical in found:
        raise ValueError(
            f"device {name!r} can't be used here ({found[canonical]}); choose one of {', '.join(usable)}"
        )
    raise ValueError(f"device must be one of {', '.join(usable)} on this machine, got {name!r}")


def _start_warp() -> ModuleType:
    """Warp, started without messages about itself; `warp_devices` reports a missing driver."""
    import tempfile

    from wive.warp_kernels.tree.quiet import quiet

    wp = importlib.import_module("warp")
    with tempfile.TemporaryFile() as messages, quiet(), _stderr_to(messages.fileno()):
        wp.init()
        messages.seek(0)
        said = messages.read().decode(errors="replace").splitlines(keepends=True)
    sys.stderr.writelines(line for line in said if not line.startswith(SAID_WITHOUT_DRIVER))
    return wp


@contextlib.contextmanager
def _stderr_to(file: int) -> Iterator[None]:
    """A block in which what C++ writes to standard error goes to another file descriptor."""
    try:
        kept = os.dup(STDERR)
    except OSError:  # there is no standard error
        yield
        return
    try:
        os.dup2(file, STDERR)
        yield
    finally:
        os.dup2(kept, STDERR)
        os.close(kept)


def _cuda_problem(wp: Any, device: Any) -> str:
    supported = wp.get_cuda_supported_archs()
    if supported and device.arch < min(supported):
        return (
            f"{device.name} has compute capability {device.arch / 10:.1f}, "
            f"this Warp needs {min(supported) / 10:.1f}: use a newer GPU or an older Warp"
        )
    return ""
