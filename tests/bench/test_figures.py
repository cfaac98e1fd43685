"""The benches' figures are drawn from stored results: a message, names beside lines, no text over text."""

import itertools
import json
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

matplotlib = pytest.importorskip("matplotlib", reason="matplotlib draws the benches' figures")

from matplotlib.figure import Figure  # noqa: E402
from matplotlib.text import Text  # noqa: E402

from bench import figures  # noqa: E402
from bench.figures import style  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "bench" / "results"
STORED = [
    name for name in figures.DRAWN if (RESULTS / f"{name}.json").exists()
]  # those that have been measured
THUMBNAIL = 300  # pixels wide
LEGIBLE = 6  # pixels of a font's size
SERIES = 4  # lines of names in a panel, at most


def stored(name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return content


@cache
def drawn(name: str) -> Figure:
    figure = figures.draw(name, stored(name))
    assert figure is not None
    figure.set_dpi(100)
    figure.draw_without_rendering()
    return figure


def texts(figure: Figure) -> list[Text]:
    """The texts that are seen: ticks beyond the limits have labels that are not drawn."""
    beyond = set()
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
        beyond |= {tick.label1 for tick in ticks if not low <= tick.get_loc() <= high}
    found = [text for text in figure.findobj(Text) if isinstance(text, Text) and text not in beyond]
    return [text for text in found if text.get_visible() and text.get_text().strip()]


@pytest.mark.parametrize("name", STORED)
def test_a_figure_has_a_message_names_beside_lines_and_text_that_can_be_read_small(name: str) -> None:
    figure = drawn(name)
    assert any(character.isdigit() for character in figure.get_suptitle()), "the message has a number"
    for axes in figure.axes:
        assert axes.get_legend() is None
        assert len({line.get_color() for line in axes.lines if len(line.get_xdata()) > 2}) <= SERIES
    assert not figure.legends
    inches = figure.get_size_inches()[0]
    assert min(text.get_size() for text in texts(figure)) / 72 * THUMBNAIL / inches >= LEGIBLE


@pytest.mark.parametrize("name", STORED)
def test_no_text_covers_another_or_leaves_the_picture(name: str) -> None:
    figure = drawn(name)
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts(figure)]
    inside = figure.bbox.padded(1)
    for text, box in boxes:
        assert inside.x0 <= box.x0 and box.x1 <= inside.x1, f"{text!r} leaves the picture"
        assert inside.y0 <= box.y0 and box.y1 <= inside.y1, f"{text!r} leaves the picture"
    for (one, first), (other, second) in itertools.combinations(boxes, 2):
        assert not first.padded(-1).overlaps(second.padded(-1)), f"{one!r} covers {other!r}"


def test_figures_are_those_of_the_stored_results() -> None:
    assert {path.stem for path in RESULTS.glob("*.png")} == set(STORED)
    assert len(STORED) >= 14


@pytest.mark.parametrize("name", STORED)
def test_the_committed_figure_says_what_the_stored_results_say(name: str) -> None:
    pillow = pytest.importorskip("PIL.Image")
    with pillow.open(RESULTS / f"{name}.png") as picture:
        assert picture.text["Title"] == drawn(name).get_suptitle(), f"run `python -m bench draw {name}`"


# The columns that a run with fewer scenes or options has fewer values of.
CHOICES = ("scene", "accuracy", "kernel", "threads", "quality", "rays", "width", "distance", "moving")


@pytest.mark.parametrize("name", STORED)
def test_results_of_one_scene_and_of_fewest_options_are_drawn(name: str) -> None:
    content = stored(name)
    for key, table in content.items():
        if isinstance(table, list) and table and isinstance(table[0], dict):
            first = {column: table[0][column] for column in CHOICES if column in table[0]}
            content[key] = [row for row in table if all(row[column] == first[column] for column in first)]
    figure = figures.draw(name, content)
    assert figure is not None
    figure.draw_without_rendering()


@pytest.mark.parametrize(("name", "table"), [("embree", "speed"), ("latency", "curve")])
def test_nothing_is_drawn_of_a_run_without_that_part(name: str, table: str) -> None:
    assert figures.draw(name, {**stored(name), table: []}) is None
    assert figures.draw("quality", {}) is None


def test_contenders_without_leaks_have_a_band_of_their_own() -> None:
    means = stored("pareto")["means"]
    leaking, tight = drawn("pareto").axes
    assert [label.get_text() for label in tight.get_yticklabels()] == ["none"]
    for axes, leaks in ((leaking, True), (tight, False)):
        speeds = {float(line.get_xdata()[0]) for line in axes.lines}
        known = [row for row in means if row["contender"] in figures.pareto.NAMES]
        assert speeds == {row["mrays"] for row in known if (row["leaks"] > 0) == leaks}


def test_names_of_lines_that_end_together_are_moved_apart() -> None:
    figure, (axes,) = style.page(4, "0", "")
    axes.set_ylim(0, 1)
    style.name_lines(
        axes, [(0.5, "one", "k"), (0.5, "two\nlines", "k"), (0.51, "three", "k"), (0, "four", "k")]
    )
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not any(first.overlaps(second) for first, second in itertools.combinations(boxes, 2))


def run(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bench", "draw", *options]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)


def test_figures_are_drawn_again_without_measuring(tmp_path: Path) -> None:
    shutil.copy(RESULTS / "dask.json", tmp_path)
    assert run("--results", str(tmp_path)).returncode == 0
    assert {path.name for path in tmp_path.iterdir()} == {"dask.json", "dask.png"}
    assert (tmp_path / "dask.json").read_bytes() == (RESULTS / "dask.json").read_bytes()


def test_what_cannot_be_drawn_is_named(tmp_path: Path) -> None:
    missing = run("pareto", "--results", str(tmp_path))
    assert missing.returncode == 2 and "run `python -m bench pareto`" in missing.stderr
    assert "no 'quotes' among build" in run("quotes").stderr
    assert not list(tmp_path.iterdir())
