"""What belongs to the whole process is changed by one thread at a time, and forking leaves no lock taken."""

import os
import threading
import warnings

import pytest
from support.at_once import at_once

from wive._internal.process_lock import PROCESS_LOCK, process_lock, without_warnings


def test_filters_of_warnings_are_as_before_when_all_threads_are_through():
    """The first thread ends its block after the second one wanted to begin its own."""
    before = warnings.filters.copy()
    inside, leaving = threading.Event(), threading.Event()

    def block(i: int) -> None:
        if i == 0:
            with without_warnings():
                inside.set()
                leaving.wait(0.1)
        else:
            inside.wait(60)
            with without_warnings():
                leaving.set()
                warnings.warn("not shown", UserWarning, stacklevel=1)

    at_once(block, 2)
    assert warnings.filters == before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of any fork while other threads run
def test_a_forked_process_finds_no_lock_taken():
    locks = [PROCESS_LOCK, process_lock()]
    taken, free = threading.Event(), threading.Event()

    def hold() -> None:
        with locks[1], locks[0]:
            taken.set()
            free.wait(0.2)

    holder = threading.Thread(target=hold)
    holder.start()
    taken.wait()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            got = []
            asking = threading.Thread(
                target=lambda: got.append([lock.acquire(timeout=5) for lock in locks]), daemon=True
            )
            asking.start()
            asking.join(20)
            status = 0 if got == [[True, True]] else 1
        finally:
            os._exit(status)
    free.set()
    holder.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
