"""The seeds of fuzz tests."""

import itertools
import secrets
import time
from collections.abc import Iterator

import pytest


@pytest.fixture
def seeds(request: pytest.FixtureRequest) -> Iterator[int]:
    """One per case: `--cases` of them, or as many as this test's share of `--minutes` takes.

    They begin at `--first`, which is 0 with `--cases` and any number with `--minutes`.
    """
    option = request.config.getoption
    first = option("--first")
    if option("--minutes") is None:
        return iter(range(first or 0, (first or 0) + option("--cases")))
    tests = [item for item in request.session.items if "seeds" in getattr(item, "fixturenames", ())]
    return seeds_for(60 * option("--minutes") / len(tests), secrets.randbits(48) if first is None else first)


def seeds_for(seconds: float, first: int) -> Iterator[int]:
    end = time.monotonic() + seconds
    for seed in itertools.count(first):
        yield seed
        if time.monotonic() > end:
            return
