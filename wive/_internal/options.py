"""The options of scenes and queries, and their checks. Every error is one line that names the option."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from typing import Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from wive._internal.progress import ProgressOption
from wive._internal.scalars import flag, integer, shown

Given = ArrayLike  # what users pass, by a name short enough for overloads
AccuracyOption = Literal["fast", "watertight", "exact"]
NodesOption = Literal["float32", "compressed"]
QualityOption = Literal["medium", "high"]
Lanes = Literal[1, 8]
LanesOption = Literal["auto", 8, 1]

# The options that not every backend has, and which backends have them.
HAVE_OPTION = {"threads": "CPU backends", "in_flight": "CPU backends", "lanes": "backend 'warp'"}
# More threads than this only cost memory.
MOST_THREADS = 4096
MOST_BYTES = 2**63 - 1


class TreeOptions(TypedDict, total=False):
    """The options of a tree and of what traces it."""

    backend: str
    device: str | None
    accuracy: AccuracyOption
    nodes: NodesOption
    quality: QualityOption
    threads: int | None


class BuildOptions(TreeOptions, total=False):
    """The options of `Scene` that all its constructors take."""

    progress: ProgressOption


class SceneOptions(BuildOptions, total=False):
    """All options of `Scene`."""

    dtype: DTypeLike | None


class QueryOptions(TypedDict, total=False):
    """The options of a query as users give them."""

    threads: int | None
    in_flight: int | None
    lanes: LanesOption
    progress: ProgressOption


class Plain(QueryOptions, total=False):
    """The options of a query that returns no counters."""

    stats: Literal[False]


class Counted(QueryOptions):
    """The options of a query that returns counters."""

    stats: Literal[True]


class PlainCount(Plain, total=False):
    """The options of `count` without counters."""

    touching: bool


class CountedCount(Counted, total=False):
    """The options of `count` with counters."""

    touching: bool


class PlainAll(PlainCount, total=False):
    """The options of `intersect_all` without counters."""

    max_bytes: int | None


class CountedAll(CountedCount, total=False):
    """The options of `intersect_all` with counters."""

    max_bytes: int | None


class Work(NamedTuple):
    """The options of a query, checked."""

    threads: int = 0  # 0 is every core
    in_flight: int = 0  # 0 leaves it to the core
    stats: bool = False
    lanes: Lanes | None = None  # None leaves it to the Warp backend
    touching: bool = False  # of several hits: every triangle touched, not every crossing
    max_bytes: int = 0  # of all hits; 0 is by what memory there is


# `Work` of a tuple, in a third of the time that `Work(...)` takes.
_work = functools.partial(tuple.__new__, Work)
# If no option is given: made once, because making it takes a tenth of the time of a one-ray query.
USUAL_WORK = Work()


def threads(value: int | None) -> int:
    """The number of threads to use; 0 is one per core that this process may run on."""
    if value is None:
        return 0
    return min(integer("threads", value, 1), MOST_THREADS)


def in_flight(value: int | None) -> int:
    """Rays interleaved per thread; 0 lets the core choose."""
    return 0 if value is None else integer("in_flight", value, 1)


def max_bytes(value: int | None) -> int:
    """The bytes that all hits may take; 0 is by what memory there is."""
    return 0 if value is None else integer("max_bytes", value, 1, MOST_BYTES)


def work(
    backend: str,
    lacks: Iterable[str],
    asked_threads: int | None,
    asked_in_flight: int | None,
    asked_lanes: LanesOption,
    stats: bool,
    touching: bool = False,
    most_bytes: int | None = None,
) -> Work:
    """The options of a query, checked; ValueError for one that the backend lacks."""
    chosen = lanes(asked_lanes)
    flags = flag("stats", stats), chosen, flag("touching", touching), max_bytes(most_bytes)
    checked = _work((threads(asked_threads), in_flight(asked_in_flight), *flags))
    refuse_lacking(backend, lacks, {"threads": asked_threads, "in_flight": asked_in_flight, "lanes": chosen})
    return checked


def refuse_lacking(backend: str, lacks: Iterable[str], given: Mapping[str, object]) -> None:
    """Raise ValueError for an option that is given (not None) and that the backend lacks."""
    for name in lacks:
        value = given.get(name)
        if value is not None:
            raise ValueError(
                f"{name} is only for {HAVE_OPTION[name]}, got {value!r} with backend {backend!r}: "
                "leave it out"
            )


def lanes(value: object) -> Lanes | None:
    """8 or 1 lanes of a node per thread; None is "auto"."""
    if (
        not isinstance(value, (str, int, np.integer))
        or isinstance(value, bool)
        or value not in ("auto", 8, 1)
    ):
        raise ValueError(f"lanes must be one of auto, 8, 1, got {shown(value)}")
    if value == "auto":
        return None
    return 8 if value == 8 else 1
