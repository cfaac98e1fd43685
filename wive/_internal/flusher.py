"""Files that are brought to the disk while they are written."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from types import TracebackType


class HelperThread(ThreadPoolExecutor):
    """A thread that does one thing after the other, and has done all at the end of a block."""

    def __init__(self) -> None:
        """The thread is made when it is needed."""
        super().__init__(1, thread_name_prefix="wive-stream")
        self._ended = False

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wait for it."""
        self.end()

    def end(self) -> None:
        """Wait for it, also if Ctrl-C comes meanwhile: the files that it uses are closed next."""
        if self._ended:
            return
        self._ended, interrupt = True, None
        last = self.submit(int)  # Python's threads can't be waited for any more once a wait was interrupted
        while not last.done():
            try:
                wait([last])
            except BaseException as error:
                interrupt = error
        self.shutdown()
        if interrupt is not None:
            raise interrupt


class Flusher:
    """Brings files to the disk on a thread of its own, so that the disk works while rays are traced.

    Systems tell of a lost write once: after an error every call raises it again.
    """

    def __init__(self) -> None:
        """The thread is made when it is needed."""
        self._thread = HelperThread()
        self._flush: Future[None] | None = None

    @property
    def is_idle(self) -> bool:
        """Whether no flush is at work."""
        return self._flush is None or self._flush.done()

    def begin(self, files: Iterable[int], then: Callable[[], object] | None = None) -> None:
        """Begin to bring open files to the disk as they are now; call `then` when they are there."""
        self.wait()
        self._flush = self._thread.submit(_flushed, set(files), then)

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
