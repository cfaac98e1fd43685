"""How many threads calls use that don't say it."""

import contextlib
import os
from collections.abc import Iterator

from wive import _cpu
from wive._internal import options
from wive._internal.process_lock import PROCESS_LOCK

VARIABLE = "WIVE_NUM_THREADS"

# What `set_threads` said; 0 is None.
_asked = 0


def set_threads(count: int | None) -> None:
    """Set how many threads calls use that don't say it by `threads=`, in all of this process.

    None is one per core that the process may use, by its affinity and by the CPU quota of its container, and
    that no other call of it uses at that time: Python threads that trace at once share the cores. At the
    start it is the number in the environment variable WIVE_NUM_THREADS, if that is set, else None.

    Raises ValueError if count is less than 1, TypeError if it is no integer.
    """
    global _asked
    asked = options.threads(count)
    with PROCESS_LOCK:
        _asked = asked
        _cpu.set_thread_count(asked)


@contextlib.contextmanager
def at_most(count: int | None) -> Iterator[None]:
    """A block whose calls, and those of other threads meanwhile, use no more than `count` threads.

    For calls that have no `threads=`: unpickling builds a tree, and verifying reads all of one. None changes
    nothing.
    """
    with PROCESS_LOCK:
        if count is not None and not 0 < _asked <= count:
            _cpu.set_thread_count(count)
    try:
        yield
    finally:
        with PROCESS_LOCK:
            _cpu.set_thread_count(_asked)


def set_by_environment() -> None:
    """Take the number in WIVE_NUM_THREADS; ValueError if it is none."""
    text = os.environ.get(VARIABLE, "").strip()
    if not text:
        return
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise ValueError(f"{VARIABLE} must be a positive integer, got {text!r:.60}: change it or unset it")
    set_threads(int(text))
