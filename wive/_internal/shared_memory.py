"""Shared memory that one process fills and frees, and others map read-only."""

from __future__ import annotations

import mmap
import os
import sys
import weakref
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from wive import _cpu

if TYPE_CHECKING:  # importing it takes long
    from multiprocessing.shared_memory import SharedMemory


class Owner:
    """The process that made the memory frees it, when this object goes or when the process ends.

    Processes that have mapped it keep it. If the process is killed, Python's resource tracker frees it.
    """

    def __init__(self, memory: SharedMemory) -> None:
        """Take over memory that this process made."""
        self.name = memory.name
        self._finalize = weakref.finalize(self, _free, memory, os.getpid())


def create(size: int, pieces: Iterable[Any]) -> Owner:
    """New shared memory that holds the pieces; MemoryError if there is not enough of it."""
    from multiprocessing.shared_memory import SharedMemory

    _cpu.expect_memory(size)
    try:
        memory = SharedMemory(create=True, size=size)
    except OSError as error:
        raise MemoryError(f"not enough shared memory for {size:,} bytes: {error.strerror}") from None
    owner = Owner(memory)
    _reserve(memory.name, size)
    buffer, at = memoryview(memory.buf or b""), 0
    for piece in pieces:
        end = at + len(piece)
        if end > at:
            buffer[at:end] = memoryview(piece)
        at = end
    del buffer
    if os.name == "posix":
        memory.close()  # this process reads it as others do
    return owner


def attach(name: str) -> Any:
    """The memory of that name, mapped read-only; FileNotFoundError if there is none."""
    if os.name != "posix":
        return _attach_to_windows(name)
    try:
        file = _open(name, os.O_RDONLY)
    except ValueError:
        raise FileNotFoundError(f"shared memory {name!r:.60}: no such name") from None
    try:
        return mmap.mmap(file, os.fstat(file).st_size, access=mmap.ACCESS_READ)
    finally:
        os.close(file)


def _attach_to_windows(name: str) -> memoryview:
    from multiprocessing.shared_memory import SharedMemory

    class Mapped(SharedMemory):
        """Memory that stays mapped while a view of it lives; Windows frees it with the last mapping."""

        def __del__(self) -> None:
            """Don't close it."""

    return memoryview(Mapped(name).buf or b"").toreadonly()


def _open(name: str, flags: int) -> int:
    """Open the memory. SharedMemory would map it for writing and, before Python 3.13, free it."""
    import _posixshmem  # type: ignore[import-not-found]

    file: int = _posixshmem.shm_open(f"/{name}", flags, mode=0o600)
    return file


def _reserve(name: str, size: int) -> None:
    """Raise MemoryError unless there is room: writing to memory that is not there kills the process."""
    if sys.platform != "linux":
        return
    file = _open(name, os.O_RDWR)
    try:
        os.posix_fallocate(file, 0, size)
    except OSError as error:
        raise MemoryError(
            f"not enough shared memory for {size:,} bytes ({error.strerror}): make /dev/shm larger, "
            "or save the scene to a file and load it"
        ) from None
    finally:
        os.close(file)


def _free(memory: SharedMemory, process: int) -> None:
    if os.getpid() == process:  # not in a process that was forked from it
        memory.unlink()
