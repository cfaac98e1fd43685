"""Output files that are whole or absent."""

import errno
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import BinaryIO

from wive._internal.lines import one_line
from wive._internal.scalars import described

PathLike = str | bytes | os.PathLike[str] | os.PathLike[bytes]

# Not kept when a file is replaced: whoever may write a file's content may not give away its owner's rights.
SET_ID = stat.S_ISUID | stat.S_ISGID
# Windows writes "\r\n" for "\n" into a descriptor that was opened without it.
BINARY: int = getattr(os, "O_BINARY", 0)


def file_name(path: PathLike) -> str:
    """A path as text; TypeError or ValueError if it is none."""
    try:
        name = os.fsdecode(path)
    except TypeError:
        raise TypeError(f"path must be a file name, got {described(path)}") from None
    if not name or "\0" in name:
        raise ValueError(f"path must be a file name, got {name!r:.60}")
    return name


def check_output(
    path: PathLike, suffix: str | tuple[str, ...] = "", inputs: Iterable[PathLike | None] = ()
) -> str:
    """Raise ValueError or OSError if `path` can't become a file that ends in `suffix`; return it as text.

    `suffix` may be several, of which one must fit. `path` must be none of the files `inputs`, by whatever
    name. Call this before long work whose result is written there.
    """
    name = file_name(path)
    if not name.lower().endswith(suffix):
        endings = suffix if isinstance(suffix, str) else f"{', '.join(suffix[:-1])} or {suffix[-1]}"
        raise ValueError(f"output file must end in {endings}, got {name!r}")
    final = os.path.realpath(name)
    folder = os.path.dirname(final)
    if not os.path.isdir(folder):
        raise FileNotFoundError(f"output folder {folder!r} does not exist: create it first")
    found = _status(final)
    if found is None:
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(f"output folder {folder!r} is not writable")
        return name
    if stat.S_ISLNK(found.st_mode):
        raise ValueError(f"output file {name!r} is a symbolic link to itself: choose another name")
    if not stat.S_ISREG(found.st_mode):
        raise ValueError(f"output file {name!r} exists and is not an ordinary file: choose another name")
    for given in inputs:
        if given is not None and _is_same(found, given):
            raise ValueError(
                f"output file {name!r} is the input file {file_name(given)!r}, which would be lost: "
                "choose another name"
            )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"output folder {folder!r} is not writable")
    if not os.access(final, os.W_OK):
        raise PermissionError(f"output file {name!r} is write-protected: choose another name")
    return name


# What is said of a full disk.
NOTHING_WRITTEN = ", nothing was written"
# How names of files begin and end that are being written, and of those that a killed process has left.
UNFINISHED = ".wive-", ".part"


@contextmanager
def atomic_write(path: PathLike) -> Iterator[BinaryIO]:
    """An open binary file that becomes `path` when the block ends, and vanishes if it raises.

    A file that is replaced keeps its mode and owner, and a symbolic link its target. OSErrors name `path`.
    """
    name = check_output(path)
    final = os.path.realpath(name)
    part = os.path.join(os.path.dirname(final), f"{UNFINISHED[0]}{os.urandom(8).hex()}{UNFINISHED[1]}")
    try:
        replaced = _status(final)
        # Nobody else may read a private file's new content, not even before it has its mode.
        mode = 0o666 if replaced is None else 0o600
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | BINARY, mode), "wb") as file:
            yield file
            put_in_place(file, part, final)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(part)
        if isinstance(error, OSError):
            raise named_error(error, name) from error
        raise


def unfinished(folder: str) -> list[str]:
    """The names of what writers that were killed have left in a folder in which none writes now."""
    begin, end = UNFINISHED
    return [name for name in os.listdir(folder) if name.startswith(begin) and name.endswith(end)]


def put_in_place(file: BinaryIO, part: str, final: str) -> None:
    """Close the file `part`, once it is on the disk, and rename it `final`; keep the mode of one there."""
    file.flush()
    replaced = _status(final)
    if replaced is not None and os.name == "posix":
        _keep_owner_and_mode(file.fileno(), replaced)
    os.fsync(file.fileno())  # some systems find out only here that the disk is full
    file.close()  # Windows renames no open files
    os.replace(part, final)


def _status(name: str) -> os.stat_result | None:
    """What is at `name`, links not followed; None if nothing is."""
    try:
        return os.lstat(name)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise named_error(error, name) from None


def _is_same(found: os.stat_result, path: PathLike) -> bool:
    try:
        return os.path.samestat(found, os.stat(file_name(path)))
    except OSError:
        return False


def _keep_owner_and_mode(file: int, replaced: os.stat_result) -> None:
    mode = stat.S_IMODE(replaced.st_mode)
    made = os.fstat(file)
    if (made.st_uid, made.st_gid) != (replaced.st_uid, replaced.st_gid):
        try:
            os.fchown(file, replaced.st_uid, replaced.st_gid)
        except OSError:
            mode &= ~SET_ID
            with suppress(OSError):
                os.fchown(file, -1, replaced.st_gid)
    if os.fstat(file).st_gid != replaced.st_gid:  # another group: it gets the rights of all others
        mode = mode & ~stat.S_IRWXG | (mode & stat.S_IRWXO) << 3
    os.fchmod(file, mode)


def named_error(error: OSError, name: str) -> OSError:
    """The error, of the same kind, with a text that names the file."""
    if error.errno is None:
        return OSError(f"{name}: {one_line(str(error)):.120}")
    reason = error.strerror or os.strerror(error.errno)
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        reason = reason.removesuffix(NOTHING_WRITTEN) + NOTHING_WRITTEN  # once, if it has been named before
    return OSError(error.errno, reason, name)
