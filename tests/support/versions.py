"""The version that the package, its citation and its changelog name.

python tests/support/versions.py [--dated]
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATED = re.compile(r"^## (\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)$", re.MULTILINE)


def _found(pattern: str, path: str) -> str:
    found = re.search(pattern, (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE)
    assert found, f"{path} names no version"
    return found[1]


def versions() -> dict[str, str]:
    """The version by the file that names it; of the changelog, the newest one that has a date."""
    return {
        "wive/__init__.py": _found(r'^__version__ = "([^"]+)"', "wive/__init__.py"),
        "CITATION.cff": _found(r"^version: (\S+)", "CITATION.cff"),
        "recipe/recipe.yaml": _found(r'^  version: "([^"]+)"', "recipe/recipe.yaml"),
        "CHANGELOG.md": _found(DATED.pattern, "CHANGELOG.md"),
    }


def is_unreleased() -> bool:
    """Whether the changelog has changes that no version has."""
    return "## Unreleased" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


if __name__ == "__main__":
    named = versions()
    if len(set(named.values())) != 1:
        sys.exit(f"these differ: {named}")
    if "--dated" in sys.argv and is_unreleased():
        sys.exit("CHANGELOG.md: give the version and the date in place of 'Unreleased'")
    print(named["wive/__init__.py"])
