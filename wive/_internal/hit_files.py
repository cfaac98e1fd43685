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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.files import PathLike, atomic_write, file_name, named_error, put_in_place
from wive._internal.lines import one_line
from wive._internal.npz_layout import NPY_HEAD, NpzLayout, Stored, npy_head

# Seconds of work that a killed run loses.
CHECKPOINT = 5.0
PART, CONTENT, STATE, RECORD = ".part", "content", "state.json", "trace.json"
COPIED = 1 << 22
# What an interrupted run must have in common with the one that goes on.
COMMON = {
    "wive": "version of wive",
    "accuracy": "accuracy",
    "precision": "precision",
    "mesh": "mesh",
    "query": "query",
    "touching": "touching",
    "rays": "number of rays",
    "kind": "kind of rays",
}


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
        self._columns = [*columns, Column("offsets", np.dtype(np.int64))] if ragged else columns
        self._files: dict[str, int] = {}
        self._begins = {column.name: NPY_HEAD for column in self._columns}
        self._lock, self._goes_on = -1, False
        self._kept = time.monotonic()
        self.done = self.hits = 0
        self._rows = 0
        self.read: list[str] = []
        self._crcs: dict[str, int] = {}
        # An npz file of known size is written in place; what grows is in files of its own first.
        self._layout = None if ragged or self.is_folder else NpzLayout(self._stored(self._count))

    def begin(self, resume: bool) -> list[str] | None:
        """Make or find the folder; the checksums of the `done` rays, None if all is complete and in place."""
        if resume and not os.path.exists(self.part) and os.path.exists(self._final):
            record = self._complete()
            if record is not None:
                self._expect_common(record["about"], f"output {self.name!r} is complete, but")
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
        found, crcs = len(arrays["prim"]), {}
        for column in self._columns:
            array = arrays[column.name]
            row = self.done + 1 if column.name == "offsets" else self._rows
            if column.name == "offsets":
                array = array[1:] + self._rows
            data = np.ascontiguousarray(array, column.dtype).reshape(-1).view(np.uint8)
            _write_at(
                self._files[column.name], memoryview(data), self._begins[column.name] + row * column.row
            )
            if self._layout is not None:
                crcs[column.name] = zlib.crc32(data, self._crcs[column.name])
        self._crcs = crcs  # here, so that an error above leaves all of the record as it was
        self._rows += found
        self.hits += found if self._ragged else int(np.count_nonzero(arrays["prim"] >= 0))
        self.done += rays
        self.read = read
        if time.monotonic() - self._kept >= CHECKPOINT:
            self._keep()

    def finish(self) -> None:
        """Put the output in place."""
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
            if self._layout is None:
                self._end_files(stored)
                self._keep()
            made = os.path.join(self._content, "npz")
            with open(made, "r+b" if self._layout is not None else "w+b") as file:
                layout = self._layout or NpzLayout(stored)
                crcs = self._crcs if self._layout is not None else self._join(layout, file.fileno())
                for place, head in layout.heads(crcs):
                    _write_at(file.fileno(), memoryview(head), place)
                tail = layout.tail(crcs, text)
                _write_at(file.fileno(), memoryview(tail), layout.end)
                os.ftruncate(file.fileno(), layout.end + len(tail))
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
            except OSError:  # no room for the record: the one before may be there
                keep = self._state() is not None
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
        state = self._state()
        if state is None:
            shutil.rmtree(self._content, ignore_errors=True)
            return
        try:
            if not resume:
                raise FileExistsError(
                    f"{one_line(self.part)}: holds {state['done']:,} rays of an interrupted run: "
                    "resume it, or delete the folder"
                )
            self._expect_common(state["about"], f"{one_line(self.part)}: the interrupted run")
        except BaseException:
            self.close()
            raise
        self._goes_on = True
        self.done, self._rows, self.hits = state["done"], state["rows"], state["hits"]
        self.read, self._crcs = state["read"], state["crcs"]

    def _open(self) -> None:
        """Open the files, of their whole size if that is known."""
        os.makedirs(self._content, exist_ok=True)
        if self._layout is not None:
            self._begins = {name: begin + NPY_HEAD for name, begin in self._layout.begins.items()}
            shared = self._opened("npz", self._layout.end)
            self._files = {column.name: shared for column in self._columns}
            heads = {array.name: npy_head(array.dtype, array.shape) for array in self._layout.arrays}
            for name, head in heads.items():
                _write_at(shared, memoryview(head), self._begins[name] - NPY_HEAD)
            self._crcs = self._crcs or {name: zlib.crc32(head) for name, head in heads.items()}
            return
        for column in self._columns:
            size = 0 if self._ragged else NPY_HEAD + self._count * column.row
            self._files[column.name] = self._opened(f"{column.name}.npy", size)
        if self._ragged:
            _write_at(self._files["offsets"], memoryview(bytes(8)), NPY_HEAD)

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
        for array in stored:
            file = self._files[array.name]
            _write_at(file, memoryview(npy_head(array.dtype, array.shape)), 0)
            os.ftruncate(file, array.size)
            os.fsync(file)

    def _join(self, layout: NpzLayout, made: int) -> dict[str, int]:
        """Copy the files to their places in the npz file; their checksums."""
        crcs = {}
        for array in layout.arrays:
            crc, place = 0, layout.begins[array.name]
            for begin in range(0, array.size, COPIED):
                data = os.pread(self._files[array.name], min(COPIED, array.size - begin), begin)
                crc = zlib.crc32(data, crc)
                _write_at(made, memoryview(data), place + begin)
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

    def _keep(self) -> None:
        """Write down how far the files are, once they are on the disk."""
        for file in set(self._files.values()):
            os.fsync(file)
        state = {
            "about": self._about,
            "done": self.done,
            "rows": self._rows,
            "hits": self.hits,
            "read": self.read,
            "crcs": self._crcs,
        }
        with atomic_write(os.path.join(self.part, STATE)) as record:
            record.write(json.dumps(state).encode())
        self._kept = time.monotonic()

    def _state(self) -> dict[str, Any] | None:
        """What was written down; None if nothing was."""
        try:
            with open(os.path.join(self.part, STATE), "rb") as file:
                state = json.load(file)
        except (OSError, ValueError):
            return None
        return state if isinstance(state, dict) and os.path.isdir(self._content) else None

    def _complete(self) -> dict[str, Any] | None:
        """The record of a complete output; None if it has none."""
        import zipfile

        try:
            if self.is_folder:
                with open(os.path.join(self._final, RECORD), "rb") as file:
                    text = file.read()
            else:
                with zipfile.ZipFile(self._final) as archive:
                    text = archive.comment
            record = json.loads(text)
            return record if {"about", "hits", "read"} <= record.keys() else None
        except (AttributeError, OSError, ValueError, zipfile.BadZipFile):
            return None

    def _expect_common(self, about: dict[str, Any], what: str) -> None:
        for key, label in COMMON.items():
            if about.get(key) != self._about[key]:
                seen = "" if key == "mesh" else f" ({about.get(key)} then, {self._about[key]} now)"
                raise ValueError(
                    f"{what} was of another {label}{seen}: give the same, delete it, or choose another output"
                )

    def refuse_other_rays(self) -> None:
        """Raise ValueError: the rays that were read before are not those of this run."""
        raise ValueError(
            f"{one_line(self.part if self._lock >= 0 else self.name)}: was of other rays: give the same, "
            "delete it, or choose another output"
        )

    def close(self) -> None:
        """Let go of the folder, as it is."""
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
