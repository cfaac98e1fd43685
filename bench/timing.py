"""Two sides measured in turn: A, B, A, B, ... on one pinned core, and the median of the pairwise ratios.

On a shared machine absolute speed drifts; two neighbours in time see the same machine, so their ratio holds.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Comparison:
    """How much faster our side is: their seconds over ours, the median and quartiles of all rounds."""

    ratio: float
    low: float
    high: float
    our_seconds: float
    their_seconds: float
    rounds: int


@dataclass(frozen=True)
class Effort:
    """When to stop: once the median's uncertainty is below `precision`, or after `most` rounds."""

    least: int = 7
    most: int = 15
    precision: float = 0.005


QUICK = Effort(least=2, most=2)


@contextmanager
def one_core() -> Iterator[None]:
    """Pins the calling thread to the last core it may run on, where the system knows how."""
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
    """The same work, done by one thread, as a function that returns the seconds of CPU time it took.

    CPU time leaves out the moments in which a shared core ran somebody else's process.
    """

    def run() -> float:
        start = time.process_time()
        work()
        return time.process_time() - start

    return run


def compare(ours: Callable[[], float], theirs: Callable[[], float], effort: Effort) -> Comparison:
    """Runs both in turn, each returning its seconds, until the ratio holds. Warming up is the caller's."""
    our_seconds: list[float] = []
    their_seconds: list[float] = []
    while True:
        our_seconds.append(ours())
        their_seconds.append(theirs())
        rounds = len(our_seconds)
        ratios = np.divide(their_seconds, our_seconds)
        low, ratio, high = (float(q) for q in np.quantile(ratios, (0.25, 0.5, 0.75)))
        # The median of n samples is uncertain by about their interquartile range over sqrt(n).
        uncertainty = (high - low) / ratio / rounds**0.5
        if rounds >= effort.least and (uncertainty < effort.precision or rounds >= effort.most):
            break
    medians = (float(np.median(our_seconds)), float(np.median(their_seconds)))
    return Comparison(ratio, low, high, *medians, rounds)


def geometric_mean(ratios: list[float]) -> float:
    """The geometric mean; NaN of nothing."""
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else float("nan")
