"""The benches' study of child orders, for tests; they skip without a compiler."""

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.append(
    str(Path(__file__).resolve().parents[2])
)  # last: an installed wive comes before the source folder
study: Any = importlib.import_module("bench.contenders.order_study")
shim: Any = importlib.import_module("bench.contenders.compiled_shim")


@pytest.fixture(scope="session")
def order_study(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The study, compiled once in a cache of its own."""
    try:
        shim.compiler()
    except shim.BenchError as problem:
        pytest.skip(str(problem))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield study
