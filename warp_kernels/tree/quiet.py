"""Warp's process-wide settings, changed while they are needed and put back; and launches."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import warp as wp

from wive import _cpu


class _Setting:
    """A setting of `wp.config` that blocks of any thread change; the last of them puts it back."""

    def __init__(self, name: str, usual: Any, changed: Any) -> None:
        """Blocks change `usual` to `changed`; any other value was chosen by the user and is left alone."""
        self._name, self._usual, self._changed = name, usual, changed
        self._blocks, self._is_ours, self._lock = 0, False, threading.Lock()

    @contextlib.contextmanager
    def change(self) -> Iterator[None]:
        """A block in which the setting is changed."""
        with self._lock:
            if self._blocks == 0:
                self._is_ours = getattr(wp.config, self._name) == self._usual
                if self._is_ours:
                    setattr(wp.config, self._name, self._changed)
            self._blocks += 1
        try:
            yield
        finally:
            with self._lock:
                self._blocks -= 1
                untouched = getattr(wp.config, self._name) == self._changed
                if self._blocks == 0 and self._is_ours and untouched:
                    setattr(wp.config, self._name, self._usual)


_log_level = _Setting("log_level", wp.LOG_INFO, wp.LOG_WARNING)
_cpu_blocks = _Setting("enable_cpu_blocks", False, True)


def quiet() -> contextlib.AbstractContextManager[None]:
    """A block in which Warp says nothing of its version, devices and modules, unless a level was set."""
    return _log_level.change()


def cpu_blocks(enabled: bool) -> contextlib.AbstractContextManager[None]:
    """A block in which Warp's CPU device runs blocks of several threads as fibers, if `enabled`."""
    return _cpu_blocks.change() if enabled else contextlib.nullcontext()


def launch(kernel: Any, dim: Any, inputs: list[Any], outputs: list[Any], **options: Any) -> None:
    """`wp.launch` in the core's floating-point environment, which decides how Warp's CPU device rounds.

    The first launch of a kernel on a device says so on standard error if Warp has to compile it.
    """
    build = kernel, str(options.get("device")), options.get("block_dim")
    nothing = 0 in (dim if isinstance(dim, tuple) else (dim,))
    with _cpu.DefaultFloats():
        if build in _launched or nothing:
            wp.launch(kernel, dim, inputs, outputs, **options)
            return
        _say_if_compiled(kernel, **options)
        with quiet():
            wp.launch(kernel, dim, inputs, outputs, **options)
        _launched.add(build)


_launched: set[tuple[Any, str, int | None]] = set()


def _say_if_compiled(kernel: Any, device: Any = None, block_dim: int = 256, **options: Any) -> None:
    """Report that the kernel is going to be compiled, which takes seconds, unless Warp's cache has it."""
    place = wp.get_device(device)
    if place.is_cpu and not wp.config.enable_cpu_blocks:
        block_dim = 1
    folder = Path(wp.config.kernel_cache_dir) / kernel.module.get_module_identifier(block_dim)
    built = "*.o" if place.is_cpu else f"*.sm{place.get_cuda_compile_arch()}*"
    if wp.config.log_level <= wp.LOG_INFO and sys.stderr is not None and not any(folder.glob(built)):
        name = kernel.func.__name__
        print(f"wive: compiling {name} for {place}, kept in {wp.config.kernel_cache_dir}", file=sys.stderr)
