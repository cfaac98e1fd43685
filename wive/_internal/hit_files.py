"""Hits of many rays, written piece by piece to an npz file or a folder of npy files that is whole or absent.

While it is written, an output `hits.npz` is in the folder `hits.npz.part`, with a record of how far it is, so
that an interrupted run can go on. Results don't depend on how rays are split, so neither does the output.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.files import PathLike, file_name, named_error, put_in_place, unfinished
from wive._internal.flusher import Flusher
from wive._internal.hit_columns import NPZ, Column, HitColumns
from wive._internal.hit_records import RECORD, STATE, expect_common, record_of, state_of, write_state
from wive._internal.lines import one_line

# Seconds of work that a killed run loses.
CHECKPOINT = 5.0
PART, CONTENT = ".part", "content"
# Bytes that are written before they are brought to the disk, which takes some ms however few they are.
FLUSHED = 1 << 24


class HitFile:
    """An output in the making."""

    def __init__(self, path: PathLike, about: dict[str, Any], columns: list[Column], ragged: bool) -> None:
        """`about` has the keys of COMMON; columns have rows per hit if `ragged`, and "offsets" is added."""
        self.name = file_name(path)
        self.is_folder = self.name.endswith(os.sep)
        self._final = os.path.realpath(self.name)
        self.part = self._final + PART
        self._content = os.path.join(self.part, CONTENT)
        self._about, self._count, self._ragged = about, int(about["rays"]), ragged
        self._columns = HitColumns(columns, self._count, ragged=ragged, is_folder=self.is_folder)
        self._lock, self._begun, self._goes_on = -1, False, False
        self._flusher, self._unflushed, self._kept = Flusher(), 0, time.monotonic()
        self.done = self.hits = 0
        self._rows = 0
        self.read: list[str] = []

    def begin(self, resume: bool) -> list[str] | None:
        """Make or find the folder; the checksums of the `done` rays, None if all is complete and in place."""
        if resume and os.path.exists(self._final) and not self._has_content():
            record = record_of(self._final, self.is_folder)
            if record is not None:
                expect_common(record["about"], self._about, f"output {self.name!r} is complete, but")
                self.done, self.hits, self.read = self._count, record["hits"], record["read"]
                if os.path.exists(self.part):  # of a run that was killed when it had put the output in place
                    self._lock_part()
                    self._remove()
                return None
        if self.is_folder and os.path.exists(self._final) and not is_empty_folder(self._final):
            raise FileExistsError(f"output folder {self.name!r} exists: choose another name, or delete it")
        self._take_part(resume)
        try:
            self._columns.open(self._content)
        except OSError as error:
            raise named_error(error, self.name) from error
        self._begun = True
        return self.read

    def write(self, arrays: dict[str, NDArray[Any]], rays: int, read: list[str]) -> None:
        """Write the hits of the next rays; `read` are the checksums of all rays up to these."""
        found = len(arrays["prim"])
        crcs, written = self._columns.write(arrays, self.done, self._rows)
        # From here on, so that an error above leaves all of the record as it was.
        self._columns.crcs = crcs
        self._rows += found
        self.hits += found if self._ragged else int(np.count_nonzero(arrays["prim"] >= 0))
        self.done += rays
        self.read = read
        self._unflushed += written
        if self._flusher.is_idle and time.monotonic() - self._kept >= CHECKPOINT:
            self._begin_keeping()
        else:
            self._flush_in_time(0)

    def finish(self) -> None:
        """Put the output in place."""
        self._flusher.wait()
        record = {"about": self._about, "hits": self.hits, "read": self.read}
        text = json.dumps(record, sort_keys=True).encode()
        if self.is_folder:
            self._columns.end_folder(self._rows)
            with open(os.path.join(self._content, RECORD), "wb") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.replace(self._content, self._final)
        else:
            self._columns.end_npz(self._rows, text, self._flush_in_time)
            self._flusher.wait()
            made = os.path.join(self._content, NPZ)
            with open(made, "r+b") as file:
                put_in_place(file, made, self._final)
        self._remove()

    def end(self, error: BaseException) -> str:
        """Keep what is done, if a run can go on after this error; where that is, or "" if it is not kept."""
        if self._lock < 0:
            return ""
        if not self._begun:
            if state_of(self.part) is None:
                self._remove()
            return ""
        keep = self.done > 0 and (self._goes_on or not isinstance(error, TypeError | ValueError))
        keep = keep and self._has_content()
        if keep:
            try:
                self._keep()
            except (OSError, MemoryError):  # no room for the record: the one before may be there
                keep = state_of(self.part) is not None
        if not keep:
            self._remove()
            return ""
        self.close()
        shown = one_line(self.part)
        return f"{self.done:,} of {self._count:,} rays are kept in {shown}: resume to go on, or delete it"

    def _has_content(self) -> bool:
        """Whether there is something of an output that is not yet in place."""
        return os.path.exists(self._content if self.is_folder else os.path.join(self._content, NPZ))

    def _lock_part(self) -> None:
        """Make the folder and lock it; OSError if another run has it, or if others have files there."""
        if sys.platform == "win32":
            raise OSError(f"{self.name}: can't be written piece by piece on Windows: use wive.stream")
        import fcntl

        try:
            os.makedirs(self.part, 0o700, exist_ok=True)  # as private as a file that is replaced may be
            lock = os.open(self.part, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._lock = lock
            except BaseException:
                self._lock = -1
                os.close(lock)
                raise
        except BlockingIOError:
            raise OSError(f"{one_line(self.part)}: another run is writing there: wait for its end") from None
        except OSError as error:
            raise named_error(error, self.part) from error
        left = unfinished(self.part)
        if not {STATE, CONTENT, *left}.issuperset(os.listdir(self.part)):
            self.close()
            raise FileExistsError(f"folder {self.part!r} is in the way: choose another output, or move it")
        for name in left:
            os.unlink(os.path.join(self.part, name))

    def _take_part(self, resume: bool) -> None:
        """Make the folder, or go on with one that is there."""
        self._lock_part()
        try:
            state = state_of(self.part)
            if state is None or not self._has_content():
                self._clear()
                return
            if not resume:
                raise FileExistsError(
                    f"{one_line(self.part)}: holds {state['done']:,} rays of an interrupted run: "
                    "resume it, or delete the folder"
                )
            expect_common(state["about"], self._about, f"{one_line(self.part)}: the interrupted run")
        except (OSError, ValueError):
            self.close()
            raise
        self._goes_on = True
        self.done, self._rows, self.hits = state["done"], state["rows"], state["hits"]
        self.read, self._columns.crcs = state["read"], state["crcs"]

    def _flush_in_time(self, written: int) -> None:
        """Begin to bring the output to the disk if enough of it is written, unless that is being done."""
        self._unflushed += written
        if self._unflushed >= FLUSHED and self._flusher.is_idle:
            self._flusher.begin(self._columns.outputs)
            self._unflushed = 0

    def _begin_keeping(self) -> None:
        """Begin to write down how far the files are, as soon as they are on the disk."""
        state = {
            "about": self._about,
            "done": self.done,
            "rows": self._rows,
            "hits": self.hits,
            "read": self.read,
            "crcs": self._columns.crcs,
        }
        self._flusher.begin(self._columns.files, partial(write_state, self.part, state))
        self._unflushed, self._kept = 0, time.monotonic()

    def _keep(self) -> None:
        """Write down how far the files are."""
        self._begin_keeping()
        self._flusher.wait()

    def refuse_other_rays(self) -> None:
        """Raise ValueError: the rays that were read before are not those of this run."""
        raise ValueError(
            f"{one_line(self.part if self._lock >= 0 else self.name)}: was of other rays: give the same, "
            "delete it, or choose another output"
        )

    def close(self) -> None:
        """Let go of the folder, as it is."""
        self._flusher.close()
        self._columns.close()
        lock, self._lock = self._lock, -1
        if lock >= 0:
            os.close(lock)

    def _remove(self) -> None:
        """Remove the folder, unless there are files of others."""
        self._flusher.close()  # it may be about to write a record
        self._clear()
        with suppress(OSError):
            os.rmdir(self.part)
        self.close()

    def _clear(self) -> None:
        """Remove what is in the folder, the record first: it must not be of other content."""
        with suppress(OSError):
            os.unlink(os.path.join(self.part, STATE))
        shutil.rmtree(self._content, ignore_errors=True)


def is_empty_folder(path: str) -> bool:
    """Whether that is a folder in which nothing is."""
    return os.path.isdir(path) and not os.listdir(path)
