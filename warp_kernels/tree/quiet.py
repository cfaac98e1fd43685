"""Warp's process-wide settings, touched as little as possible and put back."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import warp as wp

from wive import _cpu


def set_quiet() -> None:
    """Hide Warp's messages about itself (version, devices, modules compiled), unless a level was set."""
    if wp.config.log_level == wp.LOG_INFO:
        wp.config.log_level = wp.LOG_WARNING


@contextlib.contextmanager
def cpu_blocks(enabled: bool) -> Iterator[None]:
    """A context in which Warp's CPU device runs blocks of several threads as fibers, if `enabled`."""
    before = wp.config.enable_cpu_blocks
    wp.config.enable_cpu_blocks = before or enabled
    try:
        yield
    finally:
        wp.config.enable_cpu_blocks = before


def launch(kernel: Any, dim: Any, inputs: list[Any], outputs: list[Any], **options: Any) -> None:
    """`wp.launch` in the core's floating-point environment, which decides how Warp's CPU device rounds."""
    with _cpu.DefaultFloats():
        wp.launch(kernel, dim, inputs, outputs, **options)
