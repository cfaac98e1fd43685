"""Files that are brought to the disk while they are written."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from functools import partial

from wive._internal.helper_thread import HelperThread, Task


class Flusher:
    """Brings files to the disk on a thread of its own, so that the disk works while rays are traced.

    Systems tell of a lost write once: after an error every call raises it again.
    """

    def __init__(self) -> None:
        """The thread is made when it is needed."""
        self._thread = HelperThread()
        self._flush: Task[None] | None = None

    @property
    def is_idle(self) -> bool:
        """Whether no flush is at work."""
        return self._flush is None or self._flush.is_done

    def begin(self, files: Iterable[int], then: Callable[[], object] | None = None) -> None:
        """Begin to bring open files to the disk as they are now; call `then` when they are there."""
        self.wait()
        self._flush = self._thread.submit(partial(_flushed, set(files), then))

    def wait(self) -> None:
        """Wait for the flush at work; raises what it or one before raised."""
        if self._flush is not None:
            self._flush.result()

    def close(self) -> None:
        """End the thread when its flush is done."""
        self._thread.end()


def _flushed(files: set[int], then: Callable[[], object] | None) -> None:
    for file in files:
        os.fsync(file)
    if then is not None:
        then()
