"""Every bench runs on a small mesh and writes a table, a JSON file and a figure."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bench.support.report import to_json

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "bench" / "results"
SCENE = "terrain_2k"
# Errors of a machine that lacks what only some benches need.
LACKS = re.compile(r"embreex is not installed|carries no libembree4|no C\+\+ compiler|can't open Embree")

pytest.importorskip("matplotlib", reason="matplotlib draws the benches' figures")
pytest.importorskip("trimesh")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., dict[str, Any]]:
    """Runs a bench with --quick; returns the content of its JSON file. Skips if the machine lacks Embree."""
    folder = tmp_path_factory.mktemp("bench")
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache")}

    def run(name: str, *options: str) -> dict[str, Any]:
        answer = subprocess.run(
            [sys.executable, "-m", "bench", name, "--quick", "--out", str(folder), *options],
            cwd=ROOT, env=environment, capture_output=True, text=True, timeout=240, check=False,
        )  # fmt: skip
        if answer.returncode == 2 and LACKS.search(answer.stderr):
            pytest.skip(answer.stderr.strip().splitlines()[-1])
        assert answer.returncode == 0, answer.stderr
        assert (folder / f"{name}.png").stat().st_size > 10_000
        content: dict[str, Any] = json.loads((folder / f"{name}.json").read_text())
        assert {"cpu", "isa", "commit", "wive"} <= content["environment"].keys()
        return content

    return run


def test_bench_embree_finds_embrees_hits(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("embree", "--scenes", SCENE, "--accuracy", "watertight")
    assert {row["in_flight"] for row in content["speed"]} == {1, "tuned"}
    for row in content["speed"]:
        assert row["mismatches"] <= 1e-3 * row["count"]
    assert content["trees"][0]["wive_sah"] > 0


@pytest.mark.slow
def test_bench_dask_compares_threads_and_processes(bench: Callable[..., dict[str, Any]]) -> None:
    pytest.importorskip("distributed")
    content = bench("dask", "--scenes", SCENE)
    assert [row["contender"] for row in content["rows"]] == [
        "Scene.intersect", "wive.dask, threads", "wive.dask, processes",
    ]  # fmt: skip
    assert content["task_ms"] > 0 and content["making_ns"] > 0


def test_bench_closest_compares_points_and_insides(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("closest", "--scenes", SCENE)
    assert {row["kind"] for row in content["rows"]} == {"volume", "surface"}
    assert all(row["wive_ns"] > 0 for row in content["rows"])
    assert content["contains"][0]["contains"] > 0


def test_a_library_that_lacks_a_package_has_no_column_and_a_line_says_why(monkeypatch, capsys) -> None:
    pytest.importorskip("rtree")
    from bench import closest

    for missing in ("open3d", "rtree"):
        monkeypatch.setitem(sys.modules, missing, None)
    assert closest.usable() == {}
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(": ")[2].partition(": ")[0] for line in lines] == [
        "no column open3d", "no column trimesh",
    ]  # fmt: skip
    assert "open3d" in lines[0] and "trimesh" in lines[1]


def test_bench_spawn_compares_with_the_trace(bench: Callable[..., dict[str, Any]]) -> None:
    rows = bench("spawn", "--scenes", SCENE)["rows"]
    assert [row["precision"] for row in rows] == ["float32", "float64"]
    assert min(row[part] for row in rows for part in ("spawn", "points", "normals", "error_bound")) > 0


def test_bench_moving_times_every_way(bench: Callable[..., dict[str, Any]]) -> None:
    (row,) = bench("moving", "--scenes", SCENE)["rows"]
    assert row["moving"] > 100
    assert min(row[way] for way in ("geom_ms", "held_ms", "first_ms", "refit_ms", "build_ms")) > 0


def test_bench_stream_compares_every_form_of_files(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("stream", "--scenes", SCENE)
    assert len({row["form"] for row in content["rows"]}) == 7
    assert all(row["ratio"] > 0 for row in content["rows"])


@pytest.mark.skipif(not hasattr(signal, "SIGCONT"), reason="the system has no such signals")
def test_bench_interrupts_ends_calls_and_commands(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("interrupts", "--scenes", SCENE)
    assert {row["kind"] for row in content["rows"]} >= {"Scene", "trace", "wive trace", "wive render"}
    assert all(row["tries"] == 1 and row["longest"] > 0 for row in content["rows"])
    assert [row["where"] for row in content["total"]] == ["Python", "command line"]


def test_bench_paper_renders_embrees_picture(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("paper", "--scenes", SCENE)
    assert content["rows"]
    for row in content["rows"]:
        assert row["mean_difference"] < 0.01
        assert row["differing"] < 0.1


@pytest.mark.slow
def test_bench_order_traces_every_order(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("order", "--scenes", SCENE)
    orders = {"treelet", "diagonal", "slots", "none", "distance"}
    for table in ("rows", "speed"):
        assert {row["order"] for row in content[table]} == orders
    for row in content["rows"]:
        assert row["other_hits"] <= 1e-3 * row["count"]


def test_bench_inflight_counts_steps_and_measures_memory(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("inflight", "--scenes", SCENE, "--in-flight", "1,8")
    assert content["memory_latency_ns"] > 0
    assert [row["in_flight"] for row in content["rows"]] == [1, 8, "tuned"] * 2
    assert all(row["steps"] > 1 for row in content["rows"])


def test_bench_cliffs_compares_every_input(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("cliffs", "--scenes", SCENE)
    parts = {row["part"]: row for row in content["rows"]}
    assert parts.keys() == {"scale", "distance", "plane", "doubt", "leaving", "misses"}
    assert all(row["ratio"] > 0 and row["ray_us"] > 0 for row in content["rows"])
    assert 0.5 < parts["misses"]["missing"] < 1


def test_bench_packets_measures_every_view(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("packets", "--scenes", SCENE, "--widths", "16,64")
    assert len(content["rows"]) == 5 * 2 * 2  # distances, widths, queries
    assert all(row["ratio"] > 0 and row["ray_ns"] > 0 for row in content["rows"])


def test_bench_build_counts_bytes(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("build", "--scenes", SCENE, "--threads", "1", "--quality", "medium")
    assert [row["threads"] for row in content["build"]] == [1]
    assert 30 < content["trees"][0]["wive_bytes"] < 100


@pytest.mark.slow
def test_bench_python_agrees_on_closest_hits(bench: Callable[..., dict[str, Any]]) -> None:
    content = bench("python", "--scenes", SCENE)
    closest = [row for row in content["rows"] if not row["query"].startswith("all")]
    if not closest:
        pytest.skip("; ".join(content["missing"]))
    for row in closest:
        assert abs(row["wive_hits"] - row["other_hits"]) <= 1e-3 * row["count"]
    assert all(row["p50_us"] > 0 for row in content["single"])


@pytest.mark.slow
def test_bench_pareto_finds_no_leak_in_accuracies_that_promise_none(
    bench: Callable[..., dict[str, Any]],
) -> None:
    content = bench("pareto")
    means = {row["contender"]: row for row in content["means"]}
    assert {"fast", "watertight", "compressed", "exact", "float64"} <= means.keys()
    for name in ("watertight", "compressed", "exact", "float64"):
        assert means[name]["leaks"] == 0
    assert means["float64"]["t_worst"] < 1e-3
    assert all(ratio > 0 for ratio in content["float64_to_float32"].values())
    assert means["exact"]["wrong"] == 0
    assert means["exact"]["t_worst"] < 0.51
    assert all(row["mrays"] > 0 for row in means.values())


def test_a_tiled_scene_holds_every_copy(bench: Callable[..., dict[str, Any]]) -> None:
    from_one, from_six = (
        bench("build", "--scenes", name, "--threads", "1", "--quality", "medium")["trees"][0]["triangles"]
        for name in (SCENE, f"{SCENE}_tiled_3x2")
    )
    assert from_six == 6 * from_one


def test_an_unknown_scene_ends_in_one_line(bench: Callable[..., dict[str, Any]]) -> None:
    answer = subprocess.run(
        [sys.executable, "-m", "bench", "order", "--scenes", "nowhere"],
        cwd=ROOT, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert answer.returncode == 2
    assert answer.stderr.startswith("bench order: no scene 'nowhere'")
    assert answer.stderr.count("\n") == 1


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.stem)
def test_committed_results_have_one_line_per_row(path: Path) -> None:
    assert path.read_text() == to_json(json.loads(path.read_text()))


def test_json_has_one_line_per_row_and_loses_nothing() -> None:
    rows = [{"scene": "a", "steps": [1, 2]}, {"scene": "b", "steps": [], "share": 1 / 3}]
    content = {"isa": ["avx", "fma"], "tables": {"rows": rows, "pairs": [[1, 2], [3, 4]]}, "none": []}
    written = to_json(content)
    assert json.loads(written) == content
    assert written.splitlines() == [
        "{",
        ' "isa": ["avx", "fma"],',
        ' "tables": {',
        '  "rows": [',
        '   {"scene": "a", "steps": [1, 2]},',
        f'   {{"scene": "b", "steps": [], "share": {1 / 3!r}}}',
        "  ],",
        '  "pairs": [',
        "   [1, 2],",
        "   [3, 4]",
        "  ]",
        " },",
        ' "none": []',
        "}",
    ]


def quote(*options: str) -> str:
    """The output of `python -m bench quote`."""
    answer = subprocess.run(
        [sys.executable, "-m", "bench", "quote", *options],
        cwd=ROOT, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def test_the_documents_tables_are_those_of_the_results(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "benchmarks.md").read_text()
    copy = tmp_path / "benchmarks.md"
    copy.write_text(re.sub(r"(<!-- quote: .* -->\n).*?(<!-- end -->)", r"\1\2", text, flags=re.DOTALL))
    assert copy.read_text() != text
    assert quote("--document", str(copy)) == ""
    assert copy.read_text() == text


def test_a_table_without_results_stays_as_it_is(tmp_path: Path) -> None:
    document = tmp_path / "some.md"
    document.write_text("before\n<!-- quote: paper.gains -->\n\nold\n<!-- end -->\nafter\n")
    said = quote("--document", str(document), "--results", str(tmp_path))
    assert said == "paper.gains: no results yet, run `python -m bench paper`\n"
    assert "old" in document.read_text()
