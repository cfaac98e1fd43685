"""Names that pages write as code exist: of scenes and hits, of wive, and of wive.warp_kernels."""

import re

import pytest
from support.pages import ROOT

import wive

PAGES = sorted(path.relative_to(ROOT).as_posix() for path in (*ROOT.glob("docs/*.md"), ROOT / "README.md"))
CODE = re.compile(r"```python\n.*?```|`[^`\n]+`", re.DOTALL)
HITS = {*dir(wive.Hits), *dir(wive.AllHits), *wive.Hits.__annotations__, *wive.AllHits.__annotations__}


def named(page: str, prefix: str) -> set[str]:
    """What follows `prefix.` in the page's code, but for file names and other libraries' calls."""
    text = (ROOT / page).read_text(encoding="utf-8")
    if page == "docs/coming_from.md":
        text = re.sub(r"^\|[^|]*\|", "|", text, flags=re.MULTILINE)
    code = " ".join(CODE.findall(text))
    return set(re.findall(rf"(?<![\w./]){prefix}\.([a-zA-Z]\w*)\b(?!/|\.py)", code)) - {"npz", "npy"}


@pytest.mark.parametrize("page", PAGES)
def test_names_in_pages_exist(page: str) -> None:
    if page == "docs/dask.md":  # whose hits are those of wive.dask
        pytest.importorskip("distributed")
        import wive.dask as wive_dask

        assert named(page, "hits") <= {*dir(wive_dask.DaskHits), *dir(wive_dask.DaskAllHits)}
    else:
        assert named(page, "hits") <= HITS
    modules = {"_cpu", "_internal", "backend", "dask", "torch", "warp_kernels"}
    assert named(page, "wive") <= {*wive.__all__, *modules}
    of_trimesh, of_embreex = {"graph"}, {"run", "scene"}
    assert named(page, "scene") <= {*dir(wive.Scene), *of_trimesh, *of_embreex}


@pytest.mark.parametrize("page", PAGES)
def test_names_of_warp_functions_in_pages_exist(page: str) -> None:
    pytest.importorskip("warp")
    from wive import warp_kernels

    assert named(page, "wk") | named(page, "warp_kernels") <= set(dir(warp_kernels))
