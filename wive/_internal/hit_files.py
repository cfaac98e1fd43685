"""Hits of many rays, written piece by piece to an npz file or a folder of npy files that is whole or absent.

While it is written, an output `hits.npz` is in the folder `hits.npz.part`, with a record of how far it is, so
that an interrupted run can go on. Results don't depend on how rays are split, so neither does the output.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import sys
import time
import zlib
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.files import PathLike, file_name, named_error, put_in_place
from wive._internal.flusher import Flusher
from wive._internal.hit_records import RECORD, STATE, expect_common, record_of, state_of, write_state
from wive._internal.lines import one_line
from wive._internal.npz_layout import NPY_HEAD, NpzLayout, Stored, npy_head

# Seconds of work that a killed run loses.
CHECKPOINT = 5.0
PART, CONTENT = ".part", "content"
COPIED = 1 << 22
# Bytes that are brought to the disk at once.
FLUSHED = 1 << 24


class Column(NamedTuple):
    """An array that is written: a row per ray, or per hit if all hits are."""

    name: str
    dtype: np.dtype[Any]
    tail: tuple[int, ...] = ()

    @property
    def row(self) -> int:
        """Bytes of a row."""
        return int(np.prod(self.tail, dtype=np.int64)) * self.dtype.itemsize


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
        self._columns = columns
        # Columns that grow, in files of their own until they are copied into the npz file. One may grow in
        # the npz file itself, behind the offsets, whose number is known: the largest, to copy least.
        self._beside: list[Column] = []
        if ragged:
            largest = max(columns, key=lambda column: column.row)
            others = [column for column in columns if column is not largest]
            self._columns = [Column("offsets", np.dtype(np.int64)), largest, *others]
            self._beside = [] if self.is_folder else others
        self._layout = None if self.is_folder else NpzLayout(self._stored(0 if ragged else self._count))
        self._files: dict[str, int] = {}
        self._begins = {column.name: NPY_HEAD for column in self._columns}
        self._lock, self._goes_on = -1, False
        self._flusher, self._unflushed, self._kept = Flusher(), 0, time.monotonic()
        self.done = self.hits = 0
        self._rows = 0
        self.read: list[str] = []
        self._crcs: dict[str, int] = {}

    def begin(self, resume: bool) -> list[str] | None:
        """Make or find the folder; the checksums of the `done` rays, None if all is complete and in place."""
        if resume and not os.path.exists(self.part) and os.path.exists(self._final):
            record = record_of(self._final, self.is_folder)
            if record is not None:
                expect_common(record["about"], self._about, f"output {self.name!r} is complete, but")
                self.done, self.hits, self.read = self._count, record["hits"], record["read"]
                return None
        if self.is_folder and os.path.exists(self._final) and not is_empty_folder(self._final):
            raise FileExistsError(f"output folder {self.name!r} exists: choose another name, or delete it")
        self._take_part(resume)
        try:
            self._open()
        except OSError as error:
            self.end(error)
            raise named_error(error, self.name) from error
        return self.read

    def write(self, arrays: dict[str, NDArray[Any]], rays: int, read: list[str]) -> None:
        """Write the hits of the next rays; `read` are the checksums of all rays up to these."""
        found, crcs, written = len(arrays["prim"]), dict(self._crcs), 0
        for column in self._columns:
            array = arrays[column.name]
            row = self.done + 1 if column.name == "offsets" else self._rows
            if column.name == "offsets":
                array = array[1:] + self._rows
            data = np.ascontiguousarray(array, column.dtype).reshape(-1).view(np.uint8)
            _write_at(
                self._files[column.name], memoryview(data), self._begins[column.name] + row * column.row
            )
            written += 0 if column in self._beside else len(data)
            if column.name in crcs:
                crcs[column.name] = zlib.crc32(data, crcs[column.name])
        self._crcs = crcs  # here, so that an error above leaves all of the record as it was
        self._rows += found
        self.hits += found if self._ragged else int(np.count_nonzero(arrays["prim"] >= 0))
        self.done += rays
        self.read = read
        self._unflushed += written
        self._flush()

    def finish(self) -> None:
        """Put the output in place."""
        self._flusher.wait()
        record = {"about": self._about, "hits": self.hits, "read": self.read}
        text = json.dumps(record, sort_keys=True).encode()
        stored = self._stored(self._rows)
        if self.is_folder:
            self._end_files(stored)
            with open(os.path.join(self._content, RECORD), "wb") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.replace(self._content, self._final)
        else:
            made = os.path.join(self._content, "npz")
            with open(made, "r+b") as file:
                layout = NpzLayout(stored)
                crcs = self._join(layout, file.fileno()) if self._ragged else self._crcs
                for place, head in layout.heads(crcs):
                    _write_at(file.fileno(), memoryview(head), place)
                tail = layout.tail(crcs, text)
                _write_at(file.fileno(), memoryview(tail), layout.end)
                os.ftruncate(file.fileno(), layout.end + len(tail))
                self._flusher.wait()
                put_in_place(file, made, self._final)
        self._remove()

    def end(self, error: BaseException) -> str:
        """Keep what is done, if a run can go on after this error; where that is, or "" if it is not kept."""
        if self._lock < 0:
            return ""
        keep = self.done > 0 and (self._goes_on or not isinstance(error, TypeError | ValueError))
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

    def _take_part(self, resume: bool) -> None:
        """Make the folder, or go on with one that is there."""
        if sys.platform == "win32":
            raise OSError(f"{self.name}: can't be written piece by piece on Windows: use wive.stream")
        import fcntl

        try:
            os.makedirs(self.part, 0o700, exist_ok=True)  # as private as a file that is replaced may be
            self._lock = os.open(self.part, os.O_RDONLY)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            raise OSError(f"{one_line(self.part)}: another run is writing there: wait for its end") from None
        except OSError as error:
            raise named_error(error, self.part) from error
        if not {STATE, CONTENT}.issuperset(os.listdir(self.part)):
            self.close()
            raise FileExistsError(f"folder {self.part!r} is in the way: choose another output, or move it")
        state = state_of(self.part)
        if state is None or not os.path.isdir(self._content):
            shutil.rmtree(self._content, ignore_errors=True)
            return
        try:
            if not resume:
                raise FileExistsError(
                    f"{one_line(self.part)}: holds {state['done']:,} rays of an interrupted run: "
                    "resume it, or delete the folder"
                )
            expect_common(state["about"], self._about, f"{one_line(self.part)}: the interrupted run")
        except BaseException:
            self.close()
            raise
        self._goes_on = True
        self.done, self._rows, self.hits = state["done"], state["rows"], state["hits"]
        self.read, self._crcs = state["read"], state["crcs"]

    def _open(self) -> None:
        """Open the files, of their whole size if that is known."""
        os.makedirs(self._content, exist_ok=True)
        if self._layout is None:
            for column in self._columns:
                size = 0 if self._ragged else NPY_HEAD + self._count * column.row
                self._files[column.name] = self._opened(f"{column.name}.npy", size)
        else:
            beside = {column.name for column in self._beside}
            arrays = [array for array in self._layout.arrays if array.name not in beside]
            end = self._layout.begins[arrays[-1].name] + arrays[-1].size
            shared = self._opened("npz", end)
            self._files = {array.name: shared for array in arrays}
            self._files |= {name: self._opened(f"{name}.npy", 0) for name in beside}
            for array in arrays:
                self._begins[array.name] = self._layout.begins[array.name] + NPY_HEAD
            if not self._ragged:
                self._write_heads(arrays)
                self._crcs = self._crcs or {
                    array.name: zlib.crc32(npy_head(array.dtype, array.shape)) for array in arrays
                }
        if self._ragged:
            _write_at(self._files["offsets"], memoryview(bytes(8)), self._begins["offsets"])

    def _write_heads(self, arrays: list[Stored]) -> None:
        """Write the heads of the npy files."""
        for array in arrays:
            head = npy_head(array.dtype, array.shape)
            _write_at(self._files[array.name], memoryview(head), self._begins[array.name] - NPY_HEAD)

    def _opened(self, name: str, size: int) -> int:
        file = os.open(os.path.join(self._content, name), os.O_RDWR | os.O_CREAT, 0o666)
        if size > 0 and hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(file, 0, size)
            except OSError as error:
                if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS):
                    os.close(file)
                    raise
        return file

    def _end_files(self, stored: list[Stored]) -> None:
        """Write the headers and cut the files to their sizes."""
        self._write_heads(stored)
        for array in stored:
            file = self._files[array.name]
            os.ftruncate(file, array.size)
            os.fsync(file)

    def _join(self, layout: NpzLayout, made: int) -> dict[str, int]:
        """Copy what grew beside the npz file to its place there; the checksums of all."""
        self._write_heads(layout.arrays)
        beside = {column.name for column in self._beside}
        crcs = {}
        for array in sorted(layout.arrays, key=lambda array: array.name not in beside):
            crc, begin = 0, self._begins[array.name] - NPY_HEAD
            for at in range(0, array.size, COPIED):
                data = os.pread(self._files[array.name], min(COPIED, array.size - at), begin + at)
                crc = zlib.crc32(data, crc)
                if array.name in beside:
                    _write_at(made, memoryview(data), layout.begins[array.name] + at)
                    self._unflushed += len(data)
                if self._unflushed >= FLUSHED and self._flusher.is_idle:
                    self._flush_output()
            crcs[array.name] = crc
        return crcs

    def _stored(self, rows: int) -> list[Stored]:
        return [
            Stored(
                column.name,
                column.dtype,
                (self._count + 1 if column.name == "offsets" else rows, *column.tail),
            )
            for column in self._columns
        ]

    def _flush(self) -> None:
        """Bring what is written to the disk, and the record when it is due, unless that is being done."""
        if not self._flusher.is_idle:
            return
        if time.monotonic() - self._kept >= CHECKPOINT:
            self._begin_keeping()
        elif self._unflushed >= FLUSHED:
            self._flush_output()

    def _flush_output(self) -> None:
        """Begin to bring the output to the disk, without what is copied into it at the end."""
        beside = {column.name for column in self._beside}
        self._flusher.begin(file for name, file in self._files.items() if name not in beside)
        self._unflushed = 0

    def _begin_keeping(self) -> None:
        """Begin to write down how far the files are, as soon as they are on the disk."""
        state = {
            "about": self._about,
            "done": self.done,
            "rows": self._rows,
            "hits": self.hits,
            "read": self.read,
            "crcs": self._crcs,
        }
        self._flusher.begin(self._files.values(), partial(write_state, self.part, state))
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
        for file in {*self._files.values(), self._lock} - {-1}:
            os.close(file)
        self._files, self._lock = {}, -1

    def _remove(self) -> None:
        """Remove the folder."""
        with suppress(OSError):
            os.unlink(os.path.join(self.part, STATE))
        shutil.rmtree(self.part, ignore_errors=True)
        self.close()


def is_empty_folder(path: str) -> bool:
    """Whether that is a folder in which nothing is."""
    return os.path.isdir(path) and not os.listdir(path)


def _write_at(file: int, data: memoryview, place: int) -> None:
    while len(data):
        count = os.pwrite(file, data, place)
        data, place = data[count:], place + count
