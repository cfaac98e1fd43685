"""Fixtures for every test: `backend` runs a test on each backend, `scenes` loads large meshes.

`pytest --device cuda:0`, or WIVE_TEST_DEVICE=cuda:0, runs the tests of backend "warp" on that device; a
device that can't be used ends the run with the reason. The default is Warp's CPU device.
"""

import importlib.util
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from support.scene_folder import SCENES

import wive
from wive._internal import devices

# For tests of `bench`; last, so that the installed wive comes before its source folder.
sys.path.append(str(Path(__file__).resolve().parents[1]))

# Where NVIDIA's Warp is not installed, `import warp` would find the folder of its tests.
if (found := importlib.util.find_spec("warp")) is not None and found.origin is None:
    sys.modules["warp"] = None  # type: ignore[assignment]
BACKENDS = wive.backends()

DEVICE = pytest.StashKey[str]()

Mesh = tuple[np.ndarray, np.ndarray]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="also run the tests that take minutes")
    parser.addoption("--cases", type=int, default=40, help="cases per test of tests/fuzz; default: 40")
    parser.addoption("--first", type=int, help="the seed of the first of them; default: 0")
    parser.addoption(
        "--minutes",
        type=float,
        help="run the tests of tests/fuzz for so long, with new seeds if no --first is given",
    )
    parser.addoption(
        "--device",
        default=os.environ.get("WIVE_TEST_DEVICE"),
        help='Warp device for the tests of backend "warp"; default: $WIVE_TEST_DEVICE, else cpu',
    )


def pytest_configure(config: pytest.Config) -> None:
    """Make the chosen device the default one of backend "warp"."""
    device = config.getoption("--device")
    if device is not None:
        try:
            _, device = wive.backend.resolve_backend("warp", device)
        except ValueError as error:
            raise pytest.UsageError(f"--device: {error}") from None
    found = devices.warp_devices
    chosen = config.stash[DEVICE] = device or "cpu"
    devices.warp_devices = lambda: {chosen: found()[chosen], **found()}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--slow"):
        for item in items:
            if "slow" in item.keywords:
                item.add_marker(pytest.mark.skip(reason="takes minutes: run with --slow"))


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    """The name of each backend in turn; skips if this machine can't run it."""
    name: str = request.param
    if not BACKENDS[name].usable:
        pytest.skip(f"{name}: {BACKENDS[name].reason}")
    if name == "warp":
        request.getfixturevalue("one_stack_size")
    return name


@pytest.fixture
def cpu_backend(backend: str) -> str:
    """The name of each backend in turn but Warp, whose answers tests/warp compares with theirs."""
    if backend == "warp":
        pytest.skip("warp: compared in tests/warp")
    return backend


@pytest.fixture(scope="session")
def one_stack_size(pytestconfig: pytest.Config) -> Iterator[None]:
    """On Warp's CPU device trees of any depth take kernels of the stack size of support/warp_launches.py.

    Each kernel is then compiled once per run, which takes a second or two, not once per stack size.
    """
    from support.warp_launches import STACK

    from wive.warp_kernels.tree import tree

    with pytest.MonkeyPatch.context() as patch:
        if pytestconfig.stash[DEVICE] == "cpu":
            patch.setattr(tree, "STACK_SIZES", tuple(size for size in tree.STACK_SIZES if size >= STACK))
        yield


@pytest.fixture(scope="session")
def device(request: pytest.FixtureRequest, pytestconfig: pytest.Config) -> str:
    """The Warp device that tests run on; skips if Warp can't be used."""
    if not BACKENDS["warp"].usable:
        pytest.skip(f"warp: {BACKENDS['warp'].reason}")
    request.getfixturevalue("one_stack_size")
    return pytestconfig.stash[DEVICE]


@pytest.fixture(scope="session")
def usable_backends() -> list[str]:
    return [name for name, backend in BACKENDS.items() if backend.usable]


@pytest.fixture(scope="session")
def scenes() -> Callable[[str], Mesh]:
    """A function from a scene's name to its vertices and faces; skips if the scene is missing."""

    def load(name: str) -> Mesh:
        path = SCENES / f"{name}.npz"
        if not path.exists():
            pytest.skip(f"{name}: no {os.path.relpath(path)}")
        with np.load(path) as arrays:
            return arrays["vertices"], arrays["faces"]

    return load
