"""The notebooks in examples/ run from top to bottom, show what they say, and are stored without outputs."""

from pathlib import Path
from types import ModuleType

import pytest
from support.programs import EXAMPLES

NOTEBOOKS = sorted(path.name for path in EXAMPLES.glob("*.ipynb"))
PICTURES = {"first_steps.ipynb": 4, "terrain.ipynb": 4}  # a scene and plots
PAGES = EXAMPLES.parent / "docs"

# Jupyter's packages warn of their own changes to come.
pytestmark = pytest.mark.filterwarnings("default")


@pytest.fixture(scope="module")
def nbformat() -> ModuleType:
    return pytest.importorskip("nbformat")


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs_and_shows_pictures(name: str, nbformat: ModuleType, tmp_path: Path) -> None:
    for package in ("ipykernel", "matplotlib", "trimesh"):
        pytest.importorskip(package)
    nbclient = pytest.importorskip("nbclient")
    notebook = nbformat.read(EXAMPLES / name, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.get("name") == "stderr"], "warnings"
    data = [output["data"] for output in outputs if "data" in output]
    assert any("text/html" in shown and "watertight" in shown["text/html"] for shown in data), "the scene"
    pictures = [shown for shown in data if "image/png" in shown or "<img" in shown.get("text/html", "")]
    assert len(pictures) >= PICTURES[name]
    text = "".join(output.get("text", "") for output in outputs)
    if name == "first_steps.ipynb":
        assert "0 of 30,722 rays miss" in text and "[ True False]" in text and "[4]" in text


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_stored_without_outputs(name: str, nbformat: ModuleType) -> None:
    notebook = nbformat.read(EXAMPLES / name, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert not cell.get("outputs") and cell.get("execution_count") is None
    assert notebook.cells[0].source.startswith("# ")


def test_notebooks_are_those_that_the_recipes_name() -> None:
    text = (PAGES / "recipes.md").read_text(encoding="utf-8")
    assert sorted(PICTURES) == NOTEBOOKS and all(f"examples/{name}" in text for name in NOTEBOOKS)
