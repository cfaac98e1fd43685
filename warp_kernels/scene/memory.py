"""What doesn't fit into a device's memory is a MemoryError, before the process is killed for it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from wive import _cpu
from wive.warp_kernels.launching.launch import MOST_HITS

# While all hits are sorted, each is a ListedHit or ListedHit64 and a row of t, prim and uv.
HIT_BYTES = {"float32": 16 + 16, "float64": 32 + 28}
# Of the memory that is available; the rest is for what else needs some meanwhile.
PARTS_FOR_HITS, PARTS = 3, 4
NO_MEMORY = re.compile(r"Failed to allocate \d+ bytes")
MEND = "pass fewer rays at a time, or shorten them by tmax"


@contextmanager
def memory_errors() -> Iterator[None]:
    """A block in which Warp's RuntimeError for a full device is a MemoryError."""
    try:
        yield
    except RuntimeError as error:
        if not NO_MEMORY.match(str(error)):
            raise
        raise MemoryError(f"not enough memory: {error}") from error


def expect_hits_fit(count: int, precision: str, device: str, max_bytes: int) -> None:
    """Raise MemoryError if so many hits take more than `max_bytes`.

    0 is three quarters of the memory that is available in the host, which grants more than it has. CUDA
    devices grant what they have, so that allocating the hits decides.
    """
    needed = count * HIT_BYTES[precision]
    if max_bytes > 0:
        limit = max_bytes
    elif device == "cpu":
        limit = _cpu.available_memory() // PARTS * PARTS_FOR_HITS
    else:
        limit = needed
    if needed > limit:
        raise MemoryError(
            f"found {count} hits, which take {needed} bytes, more than the limit of {limit}: "
            f"{MEND}, or raise max_bytes"
        )
    if count > MOST_HITS:
        raise MemoryError(f"found {count} hits, more than a Warp array holds ({MOST_HITS}): {MEND}")
