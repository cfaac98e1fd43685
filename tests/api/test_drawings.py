"""The drawings of docs/how_it_works.md show what the core does, and are those that their script draws."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
TEXT = re.compile(r"<text\b[^>]*>(.*?)</text>", re.DOTALL)


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The modules of docs/figures."""
    pytest.importorskip("matplotlib")
    pytest.importorskip("PIL")
    monkeypatch.syspath_prepend(str(DOCS / "figures"))
    import drawing
    import how_it_works
    import small_tree

    return SimpleNamespace(drawing=drawing, how_it_works=how_it_works, small_tree=small_tree)


def order_of(treelet: tuple | int, octant: int) -> list[int]:
    """The slots of a treelet from front to back."""
    if isinstance(treelet, int):
        return [treelet]
    axis, low, high = treelet
    first, second = (high, low) if octant >> axis & 1 else (low, high)
    return order_of(first, octant) + order_of(second, octant)


def test_treelets_that_are_drawn_give_the_orders_that_are_stored(figures: SimpleNamespace) -> None:
    small = figures.small_tree
    for node in small.Tree(small.scene_over(small.segments())).nodes:
        treelet = small.treelet(node)
        for octant in range(8):
            stored = [slot for slot in node.order[octant] if slot in node.used]
            assert order_of(treelet, octant) == stored


def steps_of(small: SimpleNamespace, start: tuple[float, float], degrees: float) -> None:
    """Compare the steps of a walk with the core's counters and hit."""
    scene = small.scene_over(small.segments())
    origin, direction = small.ray(start, degrees)
    steps = small.walk(small.Tree(scene), scene, origin, direction)
    hits, stats = scene.intersect(origin, direction, in_flight=1, stats=True)
    leaves = [step for step in steps if step.reference & small.LEAF]
    assert len(steps) - len(leaves) == stats.inner_nodes[0]
    assert len(leaves) == stats.leaves[0]
    assert sum(len(step.tested) for step in leaves) == stats.triangles[0]
    found = [step.found for step in leaves if step.found >= 0]
    assert found[-1:] == [prim for prim in hits.prim if prim >= 0]


def test_walks_that_are_drawn_take_the_steps_of_the_core(figures: SimpleNamespace) -> None:
    steps_of(figures.small_tree, *figures.drawing.RAY)
    random = np.random.default_rng(3)
    for _ in range(40):
        start = tuple(random.uniform((-5.5, -3), (5.5, 3.3)))
        steps_of(figures.small_tree, start, random.uniform(0, 360))


def test_the_numbers_of_the_page_are_those_of_the_walk(figures: SimpleNamespace) -> None:
    small = figures.small_tree
    scene = small.scene_over(small.segments())
    tree = small.Tree(scene)
    _, stats = scene.intersect(*small.ray(*figures.drawing.RAY), in_flight=1, stats=True)
    leaves = sum(int(child) & small.LEAF != 0 for node in tree.nodes for child in node.child[node.used])
    assert (len(scene), len(tree.nodes), leaves) == (144, 6, 39)
    assert [int(count[0]) for count in stats] == [3, 3, 9]
    text = " ".join((DOCS / "how_it_works.md").read_text(encoding="utf-8").split())
    assert "144 triangles, which stand upright" in text
    assert "three of the six nodes and three of the 39 leaves, and is tested against nine triangles" in text


def test_the_drawings_are_those_of_the_script(
    figures: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures.how_it_works, "IMAGES", tmp_path)
    figures.how_it_works.main()
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == sorted(path.name for path in (DOCS / "images").glob("how_*"))
    for name in names:
        if name.endswith(".svg"):
            drawn, kept = (
                TEXT.findall((folder / name).read_text()) for folder in (tmp_path, DOCS / "images")
            )
            assert drawn == kept, f"{name}: run docs/figures/how_it_works.py again"


def test_every_recipe_has_its_picture(figures: SimpleNamespace) -> None:
    import recipes

    names = {path.stem.removeprefix("recipe_") for path in (DOCS / "images").glob("recipe_*.png")}
    assert names == set(recipes.PICTURES)
    text = (DOCS / "recipes.md").read_text(encoding="utf-8")
    assert all(f"images/recipe_{name}.png" in text for name in names)
