"""How far long calls are: what `progress=` tells a callable, or shows as a bar by tqdm."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from wive import _cpu
from wive._internal.process_lock import without_warnings

ProgressOption = bool | Callable[[int, int], object] | None
# Seconds between two calls.
PERIOD = 0.1

Result = TypeVar("Result")


class Progress:
    """Tells a callable how much of `total` is done, some ten times a second at most, never less than before.

    `total` itself is told once, by `finish`.
    """

    def __init__(self, tell: Callable[[int, int], object], total: int) -> None:
        """Tell nothing yet."""
        self.total = total
        self._tell, self._told = tell, -1
        self._begin, self._size = 0.0, 1.0
        self._next = time.monotonic() + PERIOD

    @contextmanager
    def part(self, begin: float, end: float) -> Iterator[None]:
        """What the block does is from `begin` to `end`, fractions of the part around it."""
        outer = self._begin, self._size
        self._begin, self._size = outer[0] + begin * outer[1], (end - begin) * outer[1]
        try:
            yield
        finally:
            self._begin, self._size = outer

    def at(self, fraction: float) -> None:
        """So much of the part at hand is done."""
        now = time.monotonic()
        done = min(int((self._begin + self._size * fraction) * self.total), self.total - 1)
        if now < self._next or done <= self._told:
            return
        self._told = done
        self._tell(done, self.total)
        self._next = time.monotonic() + PERIOD

    def finish(self) -> None:
        """All is done."""
        self._tell(self.total, self.total)


_running = threading.local()


@contextmanager
def progress_of(option: ProgressOption, total: int, unit: str, title: str) -> Iterator[Progress | None]:
    """What tells `option` how far the block is; None if nobody asks. The end is told unless the block raises.

    A bar counts `unit`s under a `title`. Without tqdm (extra `render`) there is none.
    """
    if option is None or option is False:
        yield None
        return
    with _teller(option, total, unit, title) as tell:
        progress = Progress(tell, total)
        yield progress
        progress.finish()


def reported(option: ProgressOption, total: int, unit: str, title: str, work: Callable[[], Result]) -> Result:
    """The result of `work`, which tells `option` how far it is: the core does, and `part`s of it."""
    with progress_of(option, total, unit, title) as progress:
        if progress is None:
            return work()
        outer = getattr(_running, "progress", None)
        _running.progress = progress
        try:
            result: Result = _cpu.report_to(progress.at, work)
        finally:
            _running.progress = outer
    return result


@contextmanager
def part(begin: float, end: float) -> Iterator[None]:
    """What the block does is from `begin` to `end` of the work that is `reported` on this thread, if any."""
    progress: Progress | None = getattr(_running, "progress", None)
    if progress is None:
        yield
        return
    with progress.part(begin, end):
        progress.at(0)
        yield


def checked_progress(option: object) -> ProgressOption:
    """The option; TypeError if it is none."""
    if option is None or option is True or option is False or callable(option):
        return option
    raise TypeError(
        f"progress must be True, False, None or a callable of (done, total), got {type(option).__name__}"
    )


@contextmanager
def _teller(
    option: ProgressOption, total: int, unit: str, title: str
) -> Iterator[Callable[[int, int], object]]:
    if callable(option):
        yield option
        return
    try:
        with without_warnings():  # a notebook without widgets has a bar of text
            from tqdm.auto import tqdm
    except ImportError:
        yield lambda done, total: None
        return
    with tqdm(total=total, unit=unit, unit_scale=total >= 100_000, desc=title) as bar:
        yield lambda done, total: bar.update(done - bar.n)
