"""Fixtures for every test: `backend` runs it on each one there is, `scenes` loads large meshes."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import wive

SCENES = Path(__file__).resolve().parents[2] / "shared" / "scenes"
BACKENDS = wive.backends()

Mesh = tuple[np.ndarray, np.ndarray]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run the tests that take minutes, too")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--slow"):
        for item in items:
            if "slow" in item.keywords:
                item.add_marker(pytest.mark.skip(reason="takes minutes: run with --slow"))


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    """The name of each backend in turn; skips where this machine can't run it."""
    name: str = request.param
    if not BACKENDS[name].usable:
        pytest.skip(f"{name}: {BACKENDS[name].reason}")
    return name


@pytest.fixture(scope="session")
def usable_backends() -> list[str]:
    return [name for name, backend in BACKENDS.items() if backend.usable]


@pytest.fixture(scope="session")
def scenes() -> Callable[[str], Mesh]:
    """A function from a shared scene's name to its vertices and faces; skips where the scene is not here."""

    def load(name: str) -> Mesh:
        path = SCENES / f"{name}.npz"
        if not path.exists():
            pytest.skip(f"{name}: no {os.path.relpath(path)}")
        with np.load(path) as arrays:
            return arrays["vertices"], arrays["faces"]

    return load
