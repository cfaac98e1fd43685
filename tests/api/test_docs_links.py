"""Links and file names in the pages lead somewhere: relative links, anchors, and paths of the repository."""

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob(".github/**/*.md"))
)
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)")
FOLDERS = ("cpu", "wive", "warp_kernels", "tests", "bench", "docs", "examples", ".ci", ".github")
# A path from the root; NAME stands for any name.
PATH = re.compile(rf"(?<![\w./-])(?:{'|'.join(map(re.escape, FOLDERS))})/[\w./*-]*[\w*/]")
FILE_NAME = re.compile(r"`(\w+\.(?:h|cpp|inc|pyi?))`")
SECTION_IN_CODE = re.compile(r'docs/(\w+\.md), "([^"]+)"')


@cache
def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def anchors(page: Path) -> set[str]:
    """What GitHub makes of the page's headings."""
    headings = re.findall(
        r"^#+ (.*)$", re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL), re.MULTILINE
    )
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@cache
def file_names() -> set[str]:
    return {path.name for folder in FOLDERS for path in (ROOT / folder).rglob("*")} | {
        path.name for path in ROOT.glob("*")
    }


@pytest.mark.parametrize("page", PAGES)
def test_relative_links_lead_to_files_and_headings(page: str) -> None:
    path = ROOT / page
    for target, anchor in LINK.findall(text_of(path)):
        found = path.parent / target if target else path
        assert found.exists(), f"{page}: no {target}"
        assert not anchor or anchor in anchors(found), f"{page}: no heading for {target}#{anchor}"


@pytest.mark.parametrize("page", PAGES)
def test_paths_of_the_repository_exist(page: str) -> None:
    text = text_of(ROOT / page)
    for path in set(PATH.findall(text)):
        assert "NAME" in path or any(ROOT.glob(path)), f"{page}: no {path}"
    for name in set(FILE_NAME.findall(text)):
        assert name in file_names(), f"{page}: no file {name}"


def test_sections_that_code_refers_to_exist() -> None:
    sources = [path for folder in ("cpu", "wive", "warp_kernels") for path in (ROOT / folder).rglob("*.*")]
    found = [
        (source, page, title)
        for source in sources
        if source.suffix in (".py", ".pyi", ".h", ".cpp", ".inc")
        for page, title in SECTION_IN_CODE.findall(text_of(source))
    ]
    assert found
    for source, page, title in found:
        assert f"\n## {title}\n" in text_of(ROOT / "docs" / page), f"{source}: no section {title!r} in {page}"
