"""Warp's process-wide settings, touched as little as possible and put back."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import warp as wp


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
