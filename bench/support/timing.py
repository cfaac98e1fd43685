"""Two sides measured in turn: A, B, A, B, ... on one pinned core, and the median of the pairwise ratios.

On a shared machine absolute speed drifts; the ratio of two runs right after each other hardly does.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Comparison:
    """Their seconds over ours, the median and quartiles over all rounds: above 1 our side is faster."""

    ratio: float
    low: float
    high: float
    our_seconds: float
    their_seconds: float
    rounds: int

    @property
    def uncertainty(self) -> float:
        """The relative uncertainty of the ratio: interquartile range over sqrt(n), about a median's of n."""
        return float((self.high - self.low) / self.ratio / self.rounds**0.5)

    @classmethod
    def of(cls, our_seconds: Sequence[float], their_seconds: Sequence[float]) -> "Comparison":
        """The comparison of seconds measured in turn, round by round."""
        ratios = np.divide(their_seconds, our_seconds)
        low, ratio, high = (float(q) for q in np.quantile(ratios, (0.25, 0.5, 0.75)))
        medians = (float(np.median(our_seconds)), float(np.median(their_seconds)))
        return cls(ratio, low, high, *medians, len(ratios))


@dataclass(frozen=True)
class Effort:
    """When to stop: if the median's uncertainty is below `precision`, or after `most` rounds."""

    least: int = 7
    most: int = 15
    precision: float = 0.005


QUICK = Effort(least=2, most=2)


def core_count() -> int:
    """Cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_core() -> Iterator[None]:
    """Pins the calling thread to the last core it may run on, if the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def timed(work: Callable[[], object]) -> Callable[[], float]:
    """A function that does the work, on one thread, and returns its seconds of CPU time.

    CPU time excludes the time in which a shared core runs other processes.
    """

    def run() -> float:
        start = time.process_time()
        work()
        return time.process_time() - start

    return run


def wall_timed(work: Callable[[], object]) -> Callable[[], float]:
    """A function that does the work and returns its wall-clock seconds: for work on several threads."""

    def run() -> float:
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    return run


def compare(ours: Callable[[], float], theirs: Callable[[], float], effort: Effort) -> Comparison:
    """Runs both in turn, each returning its seconds, until the ratio is known. The caller warms up."""
    return compare_in_turn([theirs, ours], effort)[1]


def compare_in_turn(runs: Sequence[Callable[[], float]], effort: Effort) -> list[Comparison]:
    """Runs all in turn until every ratio is known: the first one's seconds over each one's."""
    seconds: list[list[float]] = [[] for _ in runs]
    while True:
        for run, taken in zip(runs, seconds, strict=True):
            taken.append(run())
        outcomes = [Comparison.of(taken, seconds[0]) for taken in seconds]
        rounds, doubt = len(seconds[0]), max(outcome.uncertainty for outcome in outcomes)
        if rounds >= effort.least and (doubt < effort.precision or rounds >= effort.most):
            return outcomes


def geometric_mean(ratios: list[float]) -> float:
    """The geometric mean; NaN if there are no ratios."""
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else float("nan")
