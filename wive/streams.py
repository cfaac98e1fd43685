"""More rays than fit into memory: traced in pieces, from files and to files."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from wive import _cpu
from wive._internal import arguments
from wive._internal.files import NOTHING_WRITTEN, PathLike, check_output, file_name, named_error
from wive._internal.helper_thread import HelperThread
from wive._internal.hit_columns import Column
from wive._internal.hit_files import HitFile
from wive._internal.hit_records import RECORD_FORM
from wive._internal.progress import Progress, ProgressOption, checked_progress, progress_of
from wive._internal.ray_files import Raw, RayReader, Rays, RaySource, open_rays, raw_format
from wive.scene import Scene, expect_scene

# Makes the query of a piece, when its rays are there.
ReadyQuery = Callable[[], Callable[..., Any]]
Query = Literal["intersect", "occluded", "count", "intersect_all"]
# Rays per piece, per thread: some 30 ms of work, beside which starting threads costs nothing; what few
# threads read and write stays in the caches. At most 64 MB; of all hits, of which a ray may have many, fewer.
PIECE_PER_THREAD, PIECE, PIECE_ALL = 1 << 17, 1 << 20, 1 << 17


class Traced(NamedTuple):
    """What `wive.trace` did."""

    rays: int  # of the file
    hits: int  # of all rays
    resumed: int  # rays that an earlier run had traced
    seconds: float


def stream(
    scene: Scene,
    rays: RaySource,
    *,
    query: Query = "intersect",
    raw: DTypeLike | None = None,
    columns: str | Sequence[str] | None = None,
    first: int = 0,
    piece: int | None = None,
    progress: ProgressOption = None,
    **how: Any,
) -> Iterator[tuple[int, Any]]:
    """Trace rays in pieces: yields the number of a piece's first ray, and the piece's hits.

    Memory holds two pieces of rays, and the hits that you keep. The next piece is read while this one is
    traced.

    Arguments:
        rays: the name of a file: .npy of shape (n,6), origin and direction, or (n,8), with tmin and tmax; or
            .npz of `origins` (n,3), `directions` (n,3) and maybe `tmin`, `tmax`, compressed or not; of real
            numbers, in either byte and memory order. Or an array (n,6) or (n,8), or a tuple (origins,
            directions) and maybe tmin, tmax; it may be mapped, as by `np.load(path, mmap_mode="r")`.
        query: "intersect", "occluded", "count" or "intersect_all", whose answer comes with each piece.
        raw: the dtype of a file that holds numbers alone, such as np.float32 or ">f8".
        columns: what the numbers of a ray are, in order: "ox,oy,oz,dx,dy,dz" unless given; there may be tmin,
            tmax, and _ for what is to be skipped. For raw files.
        first: the ray to begin with.
        piece: rays per piece; unless given 2**17 per thread, at most 2**20, or 2**17 of all hits.
        progress: as for `Scene`, in rays.
        how: other keywords are those of the query, such as `threads`.

    Hits don't depend on how rays are split.

    Raises ValueError or TypeError, in one line naming the argument or the file, and OSError if the file can't
    be read.

    >>> for first, hits in wive.stream(scene, "rays.npy"):
    ...     total += np.count_nonzero(hits.mask)
    """
    ask = _query_of(scene, query, how)
    size = _piece_size(scene, piece, query, how)
    begin, format_ = arguments.integer("first", first, 0), _raw(raw, columns)
    checked_progress(progress)

    def pieces() -> Iterator[tuple[int, Any]]:
        with (
            open_rays(rays, format_) as reader,
            progress_of(progress, reader.count, "ray", "tracing") as asked,
        ):
            for number, answer, _ in _traced(ask, reader, begin, size, False, asked):
                yield number, answer

    return pieces()


def trace(
    scene: Scene,
    rays: RaySource,
    output: PathLike,
    *,
    query: Literal["intersect", "intersect_all"] = "intersect",
    raw: DTypeLike | None = None,
    columns: str | Sequence[str] | None = None,
    resume: bool = False,
    piece: int | None = None,
    progress: ProgressOption = None,
    **how: Any,
) -> Traced:
    """Trace rays to a file, in pieces; what the command `wive trace` does.

    Arguments are those of `stream`, and:
        output: an .npz file of `t`, `prim` and `uv`, as of the scene's hits, for "intersect_all" also
            `offsets`, not compressed; or a name that ends in "/": a folder of .npy files, which must be new.
        resume: go on with a run that was interrupted or killed; if there is none, begin one, and if the
            output is complete, do nothing. Scene, rays and query must be the same; `piece`, the backend, the
            form of nodes and the number of threads may differ.

    The output is whole or absent. While it is made it is in a folder beside it, whose name ends in ".part",
    and every five seconds what is done is written down there. The output of a resumed run is byte for byte
    that of a run without interruption.

    Raises what `stream` raises, and FileExistsError if there is an interrupted run and `resume` is False. If
    an error or Ctrl-C ends the run, its text says how many rays are kept.

    >>> wive.trace(scene, "rays.npy", "hits.npz", resume=True, progress=True)
    """
    begun = time.perf_counter()
    if query not in ("intersect", "intersect_all"):
        raise ValueError(f"query must be one of intersect, intersect_all to be written, got {query!r:.40}")
    ask = _query_of(scene, query, how)
    size, format_ = _piece_size(scene, piece, query, how), _raw(raw, columns)
    checked_progress(progress)
    arguments.flag("resume", resume)
    inputs = [rays] if isinstance(rays, str | bytes) or hasattr(rays, "__fspath__") else []
    check_hits_output(output, inputs)
    with open_rays(rays, format_) as reader:
        file = _hit_file(scene, reader, output, query, how)
        try:
            read = file.begin(resume)
            resumed = file.done
            with progress_of(progress, reader.count, "ray", "tracing") as asked:
                _verify(file, reader, size, file.read if read is None else read)
                if read is not None:
                    _write_all(file, ask, reader, size, asked)
                    file.finish()
        except BaseException as error:
            _tell_kept(error, file)
            raise
        finally:
            file.close()
    return Traced(reader.count, file.hits, resumed, time.perf_counter() - begun)


def check_hits_output(output: PathLike, inputs: Sequence[Any] = ()) -> str:
    """The name of an output of hits; ValueError or OSError if it can't be written."""
    name = file_name(output)
    if name.endswith(os.sep):
        check_output(os.path.join(os.path.dirname(os.path.realpath(name)), ".wive"))  # a new file beside it
        return name
    return check_output(name, ".npz", inputs)


def _query_of(scene: Scene, query: str, how: dict[str, Any]) -> ReadyQuery:
    """Makes the scene's query with the options, which are checked by a query of no rays.

    How many threads it uses is found then: the checksums of a stream's rays are no reason to use fewer.
    """
    expect_scene(scene)
    arguments.choice("query", query, ("intersect", "occluded", "count", "intersect_all"))
    if "progress" in how or "stats" in how:
        raise ValueError("stats is not for streams: leave it out")
    still = scene._at_rest()
    ask: Callable[..., Any] = getattr(still, query)
    nothing = np.empty((0, 3), still.vertices.dtype)
    ask(nothing, nothing, **how)
    if how.get("threads") is not None or "threads" in still._tracer.lacks:
        return lambda: lambda *rays: ask(*rays, **how)

    def ready() -> Callable[..., Any]:
        count = {"threads": _cpu.thread_count()}
        return lambda *rays: ask(*rays, **how | count)

    return ready


def _piece_size(scene: Scene, piece: int | None, query: str, how: dict[str, Any]) -> int:
    if piece is not None:
        return arguments.integer("piece", piece, 1)
    if query == "intersect_all":
        return PIECE_ALL
    if "threads" in scene._tracer.lacks:
        return PIECE
    return min(PIECE, PIECE_PER_THREAD * _cpu.thread_count(how.get("threads") or 0))


def _raw(raw: DTypeLike | None, columns: str | Sequence[str] | None) -> Raw | None:
    if raw is None:
        if columns is not None:
            raise ValueError("columns is only for raw files of rays: give their dtype, or leave it out")
        return None
    return raw_format(raw, columns)


def _traced(
    ask: ReadyQuery,
    reader: RayReader,
    first: int,
    piece: int,
    checksummed: bool,
    progress: Progress | None,
) -> Iterator[tuple[int, Any, list[str]]]:
    """Pieces from ray `first` on: the first ray, the answer, and the checksums of all rays read by then."""
    starts = range(first, reader.count, piece)
    if not checksummed and starts:
        reader.skip(first)

    def read(begin: int) -> tuple[Rays, list[str]]:
        rays = reader.read(min(piece, reader.count - begin), checksummed)
        return rays, reader.checksum if checksummed else []

    with HelperThread() as helper:
        coming = helper.submit(partial(read, starts[0])) if starts else None
        for i, begin in enumerate(starts):
            assert coming is not None
            rays, checksum = coming.result()
            query = ask()  # while no rays are read
            if i + 1 < len(starts):
                coming = helper.submit(partial(read, starts[i + 1]))
            answer = query(*rays)
            del rays
            yield begin, answer, checksum
            del answer
            if progress is not None:
                progress.at(min(begin + piece, reader.count) / reader.count)


def _write_all(
    file: HitFile, ask: ReadyQuery, reader: RayReader, piece: int, progress: Progress | None
) -> None:
    """Trace the rays that are left; a piece is written while the next one is traced."""
    names = ("t", "prim", "uv", "offsets")
    written = None
    with HelperThread() as helper:
        for begin, hits, checksum in _traced(ask, reader, file.done, piece, True, progress):
            arrays = {name: getattr(hits, name) for name in names if hasattr(hits, name)}
            if written is not None:
                written.result()
            rays = min(piece, reader.count - begin)
            written = helper.submit(partial(file.write, arrays, rays, checksum))
            del arrays, hits
        if written is not None:
            written.result()


def _verify(file: HitFile, reader: RayReader, piece: int, read: list[str]) -> None:
    """Read the rays that were traced before; ValueError if they are others."""
    for begin in range(0, file.done, piece):
        reader.read(min(piece, file.done - begin), True)
    if file.done and reader.checksum != read:
        file.refuse_other_rays()


def _hit_file(scene: Scene, reader: RayReader, output: PathLike, query: str, how: dict[str, Any]) -> HitFile:
    import wive

    _, vertices, faces = scene._bvh.checksums()
    about = {
        "wive": wive.__version__,
        "record": RECORD_FORM,
        "mesh": f"{vertices:016x}{faces:016x}",
        "accuracy": scene.accuracy,
        "precision": scene.precision,
        "query": query,
        "touching": bool(how.get("touching", False)),
        "rays": reader.count,
        "kind": reader.kind,
    }
    real = scene.vertices.dtype
    columns = [Column("t", real), Column("prim", np.dtype(np.int32)), Column("uv", real, (2,))]
    return HitFile(output, about, columns, query == "intersect_all")


def _tell_kept(error: BaseException, file: HitFile) -> None:
    """Keep what is done; raise the error with a text that says where that is, if it is anywhere."""
    kept = file.end(error)
    if isinstance(error, OSError) and error.errno is not None:
        named = named_error(error, file.name)
        if kept:
            reason = str(named.strerror).removesuffix(NOTHING_WRITTEN)
            raise OSError(error.errno, f"{reason}, {kept}", file.name) from error
        raise named from error
    if kept and isinstance(error, KeyboardInterrupt):
        raise KeyboardInterrupt(kept) from None
    if kept and isinstance(error, MemoryError):
        raise MemoryError(f"{error or 'not enough memory'}; {kept}") from error
