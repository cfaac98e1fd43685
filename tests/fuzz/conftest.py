"""The seeds of fuzz tests."""

from collections.abc import Iterator

import pytest


@pytest.fixture
def seeds(request: pytest.FixtureRequest) -> Iterator[int]:
    """One per case: `--cases` says how many."""
    return iter(range(request.config.getoption("--cases")))
