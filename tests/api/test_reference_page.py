"""The page of the Python interface, docs/api.md, has every public name once."""

import re
from pathlib import Path

import wive

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.md"
MODULES = {"embreex", "trimesh"}  # their names are listed one by one, or in another page


def test_every_public_name_is_on_the_page_once() -> None:
    listed = re.findall(r"^::: (wive\.[\w.]+)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(listed) == len(set(listed))
    names = {name.removeprefix("wive.") for name in listed if name.count(".") == 1}
    assert names == set(wive.__all__) - MODULES
    own = {
        name
        for name, value in vars(wive.trimesh).items()
        if getattr(value, "__module__", "") == "wive.trimesh"
    }
    public = {name for name in own if not name.startswith("_")} - {"IntersectorOptions"}
    assert {
        name.removeprefix("wive.trimesh.") for name in listed if name.startswith("wive.trimesh.")
    } == public
