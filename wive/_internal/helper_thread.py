"""A helper thread, for callers that Ctrl-C may interrupt at any moment."""

from __future__ import annotations

import _thread
from collections.abc import Callable
from queue import SimpleQueue
from types import TracebackType
from typing import Generic, TypeVar

Result = TypeVar("Result")
# Seconds after which a wait looks by itself whether it is over, if an interruption took what would wake it.
LOOK = 0.1


class Task(Generic[Result]):
    """Work that a thread does."""

    def __init__(self, work: Callable[[], Result]) -> None:
        """Not yet done."""
        self.is_done = False
        self._work: Callable[[], Result] | None = work
        self._result: Result | None = None
        self._error: BaseException | None = None
        self._wakes = _thread.allocate_lock()
        self._wakes.acquire()

    def run(self) -> None:
        """Do it. Called once, by the thread."""
        assert self._work is not None
        try:
            self._result = self._work()
        except BaseException as error:
            self._error = error
        self._work = None  # it may hold long arrays
        self.is_done = True
        self._wakes.release()

    def wait(self) -> None:
        """Wait until it is done."""
        while not self.is_done:
            self._wakes.acquire(timeout=LOOK)

    def result(self) -> Result:
        """What the work returned, or raises what it raised, once it is done."""
        self.wait()
        if self._error is not None:
            raise self._error
        return self._result  # type: ignore[return-value]  # the work's


class HelperThread:
    """A thread that does one task after the other; at the end of a block all are done.

    Not of `concurrent.futures`: Ctrl-C at the wrong moment leaves a lock of a future taken for ever, and a
    wait for its threads that was interrupted is over, though they go on.
    """

    def __init__(self) -> None:
        """The thread is made for the first task."""
        self._tasks: SimpleQueue[Callable[[], None] | None] | None = None

    def submit(self, work: Callable[[], Result]) -> Task[Result]:
        """Let the thread do this when all before is done."""
        if self._tasks is None:
            tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
            _thread.start_new_thread(_serve, (tasks,))
            self._tasks = tasks
        task = Task(work)
        self._tasks.put(task.run)
        return task

    def end(self) -> None:
        """Wait for all, also if Ctrl-C comes meanwhile: the files that tasks use are closed next."""
        if self._tasks is None:
            return
        last, interrupt = self.submit(int), None
        while not last.is_done:
            try:
                last.wait()
            except BaseException as error:
                interrupt = error
        self._tasks.put(None)
        self._tasks = None
        if interrupt is not None:
            raise interrupt

    def __enter__(self) -> HelperThread:
        """The thread."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wait for all."""
        self.end()


def _serve(tasks: SimpleQueue[Callable[[], None] | None]) -> None:
    while (run := tasks.get()) is not None:
        run()
        del run
