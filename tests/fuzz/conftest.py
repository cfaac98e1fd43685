"""The seeds of fuzz tests."""

import itertools
import secrets
import time
from collections.abc import Iterator

import pytest


@pytest.fixture
def seeds(request: pytest.FixtureRequest) -> Iterator[int]:
    """One per case: `--cases` from `--first` on, or new ones while this test's share of `--minutes` lasts."""
    option = request.config.getoption
    if option("--minutes") is None:
        return iter(range(option("--first"), option("--first") + option("--cases")))
    tests = [item for item in request.session.items if "seeds" in getattr(item, "fixturenames", ())]
    return new_seeds(60 * option("--minutes") / len(tests))


def new_seeds(seconds: float) -> Iterator[int]:
    end = time.monotonic() + seconds
    for seed in itertools.count(secrets.randbits(48)):
        yield seed
        if time.monotonic() > end:
            return
