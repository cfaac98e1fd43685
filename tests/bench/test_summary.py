"""The summary tables of README.md and docs/benchmarks.md repeat what the quoted tables below them say."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
KINDS = ("primary", "diffuse", "random", "shadow")


def cells(line: str) -> list[str]:
    return [re.sub(r"[*\[]|\]\(.*?\)", "", cell).strip() for cell in line.strip().strip("|").split("|")]


def quoted(name: str, accuracy: str) -> list[str]:
    """Geometric mean and lowest for each kind of rays, as the summaries have them."""
    match = re.search(rf"<!-- quote: embree\.{name} -->(.*?)<!-- end -->", BENCHMARKS, re.DOTALL)
    assert match
    rows = [cells(line) for line in match[1].splitlines() if line.startswith("|")]
    by_name = {row[0]: row for row in rows}
    columns = [rows[0].index(f"{accuracy}<br>{kind}") for kind in KINDS]
    return [f"{by_name['geometric mean'][i]} ({by_name['lowest'][i]})" for i in columns]


def summary(text: str, section: str, start: str) -> list[str]:
    """The values of the first row after `section` that begins with `start`."""
    lines = text[text.index(section) :].splitlines()
    return next(
        cells(line)[1:] for line in lines if line.startswith("|") and cells(line)[0].startswith(start)
    )


@pytest.mark.parametrize(
    "accuracy, section", [("watertight", "against Embree robust"), ("fast", "Embree's default")]
)
@pytest.mark.parametrize("name, row", [("in_flight", "batch"), ("one_ray", "one ray at a time")])
@pytest.mark.parametrize("kernel, shown", [("avx512", "AVX-512"), ("avx2", "AVX2")])
def test_the_first_table_is_that_of_the_quoted_ones(
    accuracy: str, section: str, name: str, row: str, kernel: str, shown: str
) -> None:
    assert summary(BENCHMARKS, section, f"{row}, {shown}") == quoted(f"{kernel}_{name}", accuracy)


@pytest.mark.parametrize(
    "row, accuracy, name",
    [
        ("`watertight` against Embree robust, batch", "watertight", "avx512_in_flight"),
        ("`watertight` against Embree robust, one ray", "watertight", "avx512_one_ray"),
        ("`fast` against Embree, one ray", "fast", "avx512_one_ray"),
    ],
)
def test_the_readmes_table_is_that_of_the_quoted_ones(row: str, accuracy: str, name: str) -> None:
    assert summary(README, "Speed, above 1", row) == quoted(name, accuracy)
