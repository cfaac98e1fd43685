"""The table of trimesh's calls in docs/coming_from.md: both sides of a row give the same."""

import re

import numpy as np
import pytest
from support.pages import ROOT

import wive

PAGE = (ROOT / "docs" / "coming_from.md").read_text(encoding="utf-8")
TABLE = PAGE[PAGE.index("## trimesh") : PAGE.index("## embreex")]
CALLS = re.findall(r"^\| `([^`]+)`[^|]*\| `([^`]+)`(?:, [^`|]*)? \|$", TABLE, re.MULTILINE)
# The first expression of a row, and what its second cell makes of the result.
WITH_ATTRIBUTES = re.findall(r"^\| `([^`]+)` \| `(\w) = ([^`]+)`, then `([^`]+)` \|$", TABLE, re.MULTILINE)


@pytest.fixture(scope="module")
def names() -> dict[str, object]:
    """What the table's expressions use."""
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.annulus(r_min=0.5, r_max=1, height=2, sections=17)
    random = np.random.default_rng(5)
    origins = random.uniform(-2, 2, (200, 3))
    directions = random.standard_normal((200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return {
        "mesh": mesh, "scene": wive.Scene(mesh), "trimesh": trimesh, "points": origins * 0.6,
        "origins": origins, "directions": directions,
    }  # fmt: skip


def value(code: str, names: dict[str, object]) -> object:
    """What an expression of the table gives; closest points by wive, since trimesh needs SciPy for them."""
    if "proximity" not in code:
        return eval(code, dict(names))
    with wive.trimesh.installed():
        return eval(code, dict(names))


@pytest.mark.parametrize(("theirs", "ours"), [row for row in CALLS if "camera" not in row[0]])
def test_calls_give_the_same(theirs: str, ours: str, names: dict[str, object]) -> None:
    found, expected = (np.asarray(value(code, names), np.float64) for code in (ours, theirs))
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert len(np.unique(expected.round(3))) > 1


@pytest.mark.parametrize(("theirs", "name", "ours", "attributes"), WITH_ATTRIBUTES)
def test_results_have_the_same_parts(
    theirs: str, name: str, ours: str, attributes: str, names: dict[str, object]
) -> None:
    call = theirs.partition(" = ")[2] or theirs
    rays = "origins, directions"
    expected = value(call.replace("...", rays), names)
    found = eval(attributes, {**names, name: eval(ours.replace("...", rays), dict(names))})
    rows = [np.lexsort(np.round(np.c_[parts[0], parts[-1]], 5).T) for parts in (found, expected)]
    if "closest" in theirs:
        rows = [slice(None)] * 2
    for mine, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(np.asarray(mine)[rows[0]], np.asarray(other)[rows[1]], atol=1e-5)


def test_the_table_has_rows_to_compare() -> None:
    assert len(CALLS) >= 5
    assert len(WITH_ATTRIBUTES) >= 2
