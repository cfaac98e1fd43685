"""Locks of what all threads of the process share, and blocks without warnings."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager


def process_lock() -> threading.RLock:
    """A lock that forking waits for: the child would find one that another thread holds taken for ever.

    Forking takes locks in the reverse order in which they were made. So a thread that holds one may take
    another only if that was made earlier.
    """
    lock = threading.RLock()
    if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
        os.register_at_fork(before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release)
    return lock


# For steps of microseconds. Callbacks of weak references take it, in any thread, its holder's as well.
PROCESS_LOCK = process_lock()
_filters_lock = process_lock()


@contextmanager
def without_warnings() -> Iterator[None]:
    """A block that warns of nothing; one thread at a time, because the filters are the process's.

    If two overlapped, the one that ended last would put back what the first had changed.
    """
    with _filters_lock, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
