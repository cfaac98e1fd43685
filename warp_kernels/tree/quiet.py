"""Warp's process-wide settings, touched as little as possible and put back."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import warp as wp


def hush() -> None:
    """Hide Warp's messages about itself (version, devices, modules compiled), unless a level was set."""
    if wp.config.log_level == wp.LOG_INFO:
        wp.config.log_level = wp.LOG_WARNING


@contextlib.contextmanager
def cpu_blocks(enabled: bool) -> Iterator[None]:
    """Within it, blocks of several threads run on Warp's CPU device as fibers, where `enabled`."""
    before = wp.config.enable_cpu_blocks
    wp.config.enable_cpu_blocks = before or enabled
    try:
        yield
    finally:
        wp.config.enable_cpu_blocks = before
