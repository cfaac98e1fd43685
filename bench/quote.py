"""Writes the tables of docs/benchmarks.md from the files in bench/results.

A table goes between `<!-- quote: NAME -->` and `<!-- end -->`, and replaces the text there. A table whose
results are missing stays as it is.
"""

import argparse
import json
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import median

from bench.support import report
from bench.support.groups import distinct, grouped
from bench.support.timing import geometric_mean

DOCUMENT = report.REPOSITORY / "docs" / "benchmarks.md"
QUOTE = re.compile(r"(<!-- quote: ([\w.]+) -->\n).*?(<!-- end -->)", re.DOTALL)
ACCURACIES = ("fast", "watertight")

Table = Callable[[report.Row], str]


def main(options: Sequence[str]) -> None:
    """Rewrites the document, and prints which tables have no results."""
    parser = argparse.ArgumentParser(prog="python -m bench quote", description=__doc__)
    parser.add_argument("--document", type=Path, default=DOCUMENT)
    parser.add_argument("--results", type=Path, default=report.RESULTS, help="the folder of JSON files")
    chosen = parser.parse_args(options)
    text = chosen.document.read_text()
    report.write_text(chosen.document, quoted(text, chosen.results))
    for name in sorted({match[2] for match in QUOTE.finditer(text)}):
        bench = name.split(".")[0]
        if not (chosen.results / f"{bench}.json").exists():
            print(f"{name}: no results yet, run `python -m bench {bench}`")


def quoted(text: str, results: Path) -> str:
    """The text with its tables made from the results."""

    def fresh(match: re.Match[str]) -> str:
        path = results / f"{match[2].split('.')[0]}.json"
        if not path.exists():
            return match[0]
        return f"{match[1]}\n{TABLES[match[2]](json.loads(path.read_text()))}\n{match[3]}"

    return QUOTE.sub(fresh, text)


def markdown(columns: Sequence[str], rows: Iterable[Sequence[object]], texts: int = 1) -> str:
    """A table; the first `texts` columns to the left, the others to the right."""
    lines = [columns, ["---"] * texts + ["---:"] * (len(columns) - texts), *rows]
    return "".join("| " + " | ".join(map(str, line)) + " |\n" for line in lines)


def where(rows: Sequence[report.Row], **wanted: object) -> list[report.Row]:
    """The rows with these values."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def pivot(
    rows: Sequence[report.Row], value: str, heads: Sequence[tuple[str, report.Row]], form: str = "{:.2f}"
) -> str:
    """A line per scene, a column per (title, wanted values), and below them the means and the lowest."""
    columns = [where(rows, **wanted) for _, wanted in heads]
    lines: list[list[object]] = []
    for scene, triangles in distinct(rows, "scene", "triangles"):
        cells = [[form.format(row[value]) for row in where(column, scene=scene)] for column in columns]
        lines.append([scene, f"{triangles:,}", *(cell[0] if cell else "" for cell in cells)])
    values = [[float(row[value]) for row in column] for column in columns]
    lines.append(["**geometric mean**", "", *(f"**{geometric_mean(column):.2f}**" for column in values)])
    lines.append(["**lowest**", "", *(form.format(min(column)) for column in values)])
    return markdown(["scene", "triangles", *(title for title, _ in heads)], lines)


def embree_speed(kernel: str, in_flight: object) -> Table:
    """Speed against Embree: accuracies by kinds of rays."""

    def table(content: report.Row) -> str:
        rows = where(content["speed"], kernel=kernel, in_flight=in_flight, nodes="float32")
        heads = [
            (f"{accuracy}<br>{kind}", {"accuracy": accuracy, "rays": kind})
            for accuracy in ACCURACIES
            for (kind,) in distinct(rows, "rays")
        ]
        return pivot(rows, "ratio", heads)

    return table


def embree_compressed(content: report.Row) -> str:
    """Compressed nodes: their ratio to Embree over that of float32 nodes."""
    rows = where(content["speed"], kernel="avx512", accuracy="watertight")
    keys = ("scene", "in_flight", "rays")
    plain = {tuple(row[key] for key in keys): row["ratio"] for row in where(rows, nodes="float32")}
    relative = [
        {**row, "relative": row["ratio"] / plain[tuple(row[key] for key in keys)]}
        for row in where(rows, nodes="compressed")
    ]
    heads = [
        (f"{'one ray' if flight == 1 else 'in flight'}<br>{kind}", {"in_flight": flight, "rays": kind})
        for (flight,) in sorted(distinct(relative, "in_flight"), key=lambda key: key == (1,))
        for (kind,) in distinct(relative, "rays")
    ]
    return pivot(relative, "relative", heads)


def embree_build(content: report.Row) -> str:
    """Build time, SAH cost and bytes per triangle."""
    lines = []
    for tree in content["trees"]:
        times = {row["threads"]: row for row in where(content["build"], scene=tree["scene"])}
        many = times[max(times)]
        lines.append(
            [
                tree["scene"],
                f"{tree['triangles']:,}",
                *(f"{times[threads]['ratio']:.2f}" for threads in sorted(times)),
                f"{many['wive_seconds']:.3f}",
                f"{tree['wive_sah']:.2f} / {tree['embree_sah']:.2f}",
                f"{tree['wive_bytes']:.1f} / {tree['embree_bytes']:.1f}",
            ]
        )
    threads = sorted({row["threads"] for row in content["build"]})
    heads = [f"build, {number} thread{'s' * (number > 1)}" for number in threads]
    seconds = f"seconds, {threads[-1]} threads"
    sides = ["SAH cost, wive / Embree", "bytes per triangle, wive / Embree"]
    return markdown(["scene", "triangles", *heads, seconds, *sides], lines)


def build_growth(content: report.Row) -> str:
    """Cost of building by size of the mesh."""
    lines = []
    trees = {(row["scene"], row["quality"]): row for row in content["trees"]}
    for scene, quality in distinct(content["build"], "scene", "quality"):
        rows = where(content["build"], scene=scene, quality=quality)
        tree = trees[scene, quality]
        lines.append(
            [
                scene,
                quality,
                f"{tree['triangles']:,}",
                "<br>".join(f"{row['wive_ns_per_triangle']:.0f}" for row in rows),
                "<br>".join(f"{row['embree_ns_per_triangle']:.0f}" for row in rows),
                "<br>".join(f"{row['ratio']:.2f}" for row in rows),
                f"{tree['sah_ratio']:.3f}",
                f"{tree['wive_bytes']:.1f} / {tree['embree_bytes']:.1f}",
            ]
        )
    heads = ["ns per triangle, wive", "Embree", "ratio", "SAH ratio", "bytes per triangle"]
    return markdown(["mesh", "quality", "triangles", *heads], lines, 2)


def paper_gains(content: report.Row) -> str:
    """Gain in percent of each kernel, one ray at a time and in flight."""
    heads = [
        (f"{kernel}<br>{accuracy}<br>{'one ray' if flight == 1 else 'in flight'}", (kernel, accuracy, flight))
        for accuracy, kernel, flight in distinct(content["rows"], "accuracy", "kernel", "in_flight")
    ]
    lines: list[list[object]] = []
    for (scene,) in distinct(content["rows"], "scene"):
        rows = where(content["rows"], scene=scene)
        gains = {(row["kernel"], row["accuracy"], row["in_flight"]): row["gain"] for row in rows}
        lines.append([scene, *(f"{gains[key]:+.0f} %" for _, key in heads)])
    means = {(row["kernel"], row["accuracy"], row["in_flight"]): row for row in content["means"]}
    lines.append(["**mean**", *(f"**{means[key]['mean_gain']:+.0f} %**" for _, key in heads)])
    return markdown(["scene", *(title for title, _ in heads)], lines)


def python_single(content: report.Row) -> str:
    """Microseconds per call for one ray, the median over scenes."""
    lines = []
    for query, caller in distinct(content["single"], "query", "caller"):
        times = sorted(row["p50_us"] for row in where(content["single"], query=query, caller=caller))
        lines.append([query, caller, f"{times[len(times) // 2]:.1f}"])
    return markdown(["query", "caller", "microseconds per call"], lines, 2)


def order_means(content: report.Row) -> str:
    """Steps and speed of each order, geometric means over scenes."""
    speeds = {(row["rays"], row["order"], row["in_flight"]): row["speed"] for row in content["speed_means"]}
    lines = [
        [row["rays"], row["order"], f"{row['nodes_vs_distance']:.3f}", f"{row['triangles_vs_distance']:.3f}"]
        + [f"{speeds[(row['rays'], row['order'], flight)]:.2f}" for flight in (1, "tuned")]
        for row in content["means"]
    ]
    heads = ["inner nodes", "triangles", "speed, one ray", "speed, in flight"]
    return markdown(["rays", "order", *heads], lines, 2)


def order_scenes(content: report.Row) -> str:
    """Inner nodes, leaves and triangles per ray, per scene and order."""
    orders = [order for (order,) in distinct(content["rows"], "order")]
    lines: list[list[object]] = []
    for scene, kind in distinct(content["rows"], "scene", "rays"):
        rows = {row["order"]: row for row in where(content["rows"], scene=scene, rays=kind)}
        steps = ("inner_nodes", "leaves", "triangles")
        cells = [" ".join(f"{rows[order][step]:.2f}" for step in steps) for order in orders]
        lines.append([scene, kind, *cells])
    return markdown(["scene", "rays", *map(str, orders)], lines, 2)


def pareto_means(content: report.Row) -> str:
    """Speed and errors of each contender."""
    lines = [
        [row["contender"], f"{row['mrays']:.2f}", f"{row['single']:.2f}" if row["single"] else ""]
        + [f"{1e6 * row[key]:.1f}" for key in ("leaks", "wrong")]
        + [f"{row[key]:.3g}" for key in ("t_median", "t_worst")]
        for row in content["means"]
    ]
    heads = ["Mray/s", "one ray", "leaks, ppm", "wrong triangle, ppm", "t, median ulp", "t, worst ulp"]
    return markdown(["contender", *heads], lines)


def pareto_scenes(content: report.Row) -> str:
    """Each contender's share of the speed of `fast` on scenes."""
    keys = ("mean_mrays", "lowest_mrays", "mean_single", "lowest_single")
    lines = [[row["contender"], *(f"{row[key]:.2f}" for key in keys)] for row in content["scene_means"]]
    heads = ["in flight, geometric mean", "lowest", "one ray, geometric mean", "lowest"]
    return markdown(["contender", *heads], lines)


def listed(part: str, columns: dict[str, str], texts: int = 1) -> Table:
    """A line per row of a part of the results; columns are titles and what of the row they have."""
    return lambda content: markdown(
        list(columns), [[cell.format(**row) for cell in columns.values()] for row in content[part]], texts
    )


def stream_speed(content: report.Row) -> str:
    """Speed of streams over one batch in memory, and the share of their CPU time that it would take."""
    scenes = [scene for (scene,) in distinct(content["rows"], "scene")]
    lines = []
    for (form,) in distinct(content["rows"], "form"):
        rows = [where(content["rows"], scene=scene, form=form)[0] for scene in scenes]
        lines.append(
            [form, *(f"{row['ratio']:.2f}" for row in rows), *(f"{row['work']:.2f}" for row in rows)]
        )
    return markdown(["form", *(f"{kind}, {scene}" for kind in ("speed", "work") for scene in scenes)], lines)


def latency_compare(content: report.Row) -> str:
    """Speed of the Warp kernels over Warp's own query with its SAH tree: accuracies by kinds of rays."""
    rows = where(content["compare"], builder="sah", lanes=8)
    heads = [
        (f"{accuracy}<br>{kind}", {"accuracy": accuracy, "rays": kind})
        for accuracy in ACCURACIES
        for (kind,) in distinct(rows, "rays")
    ]
    return pivot(rows, "ratio", heads)


def interrupts_kinds(content: report.Row) -> str:
    """Tries of each kind of call or command, and the median of the scenes' medians and the longest, in ms."""
    lines = []
    for key, rows in grouped(content["rows"], ("where", "kind")):
        middle = median(row["median"] for row in rows)
        longest = max(row["longest"] for row in rows)
        lines.append([*key.values(), sum(row["tries"] for row in rows), f"{middle:.0f}", f"{longest:.0f}"])
    return markdown(["where", "kind", "tries", "median, ms", "longest, ms"], lines, texts=2)


def peers_means(content: report.Row) -> str:
    """Speed over other libraries' trees: geometric mean over the scenes, and lowest."""
    ways = ("watertight", "fast", "one_ray")
    lines = []
    for key, rows in grouped(content["rows"], ("peer", "builder", "rays")):
        ratios = [[float(row[way]) for row in rows] for way in ways]
        lines.append(
            [*key.values(), *(f"{geometric_mean(found):.2f} ({min(found):.2f})" for found in ratios)]
        )
    heads = ["`watertight`, batch", "`fast`, batch", "`fast`, one ray"]
    return markdown(["peer", "its builder", "rays", *heads], lines, texts=3)


TABLES: dict[str, Table] = {
    "embree.avx512_in_flight": embree_speed("avx512", "tuned"),
    "embree.avx512_one_ray": embree_speed("avx512", 1),
    "embree.avx2_in_flight": embree_speed("avx2", "tuned"),
    "embree.avx2_one_ray": embree_speed("avx2", 1),
    "embree.compressed": embree_compressed,
    "embree.build": embree_build,
    "build.growth": build_growth,
    "paper.gains": paper_gains,
    "python.means": listed("means", {
        "query": "{query}", "other": "{other}", "ours": "{ours}", "threads": "{threads}",
        "geometric mean": "{mean:.1f}", "lowest": "{lowest:.1f} ({lowest_at})",
    }, texts=3),
    "python.single": python_single,
    "inflight.best": listed("best", {
        "scene": "{scene}", "rays": "{rays}", "triangles": "{triangles:,}", "tree, MiB": "{tree_mib:.1f}",
        "best K": "{best}", "speed over K = 1": "{speedup:.2f}", "default's": "{tuned:.2f}",
        "Mray/s": "{mrays:.1f}", "latency, ns": "{latency_ns:.0f}",
    }, texts=2),
    "order.means": order_means,
    "order.scenes": order_scenes,
    "dask.speed": listed("rows", {
        "two cores": "{contender}", "speed": "{speed:.2f}", "quartiles": "{low:.2f} to {high:.2f}",
        "Mray/s": "{mrays:.1f}",
    }),
    "closest.points": listed("rows", {
        "scene": "{scene}", "points": "{kind}", "triangles": "{triangles:,}",
        "wive, ns per point": "{wive_ns:.0f}", "Open3D": "{open3d:.1f}", "trimesh": "{trimesh:.0f}",
    }, texts=2),
    "spawn.parts": listed("rows", {
        "scene": "{scene}", "precision": "{precision}", "closest hits, ns per ray": "{intersect_ns:.0f}",
        "spawn": "{spawn:.2f}", "points": "{points:.2f}", "normals": "{normals:.2f}",
        "error_bound": "{error_bound:.2f}", "spawn, of any hits": "{of_occluded:.2f}",
    }, texts=2),
    "latency.compare": latency_compare,
    "stream.speed": stream_speed,
    "interrupts.kinds": interrupts_kinds,
    "interrupts.total": listed("total", {
        "where": "{where}", "tries": "{tries}", "median, ms": "{median:.0f}", "99 %, ms": "{p99:.0f}",
        "longest, ms": "{longest:.0f}",
    }),
    "peers.means": peers_means,
    "peers.builds": listed("builds", {
        "scene": "{scene}", "triangles": "{triangles:,}", "peer": "{peer}", "usual / medium": "{usual:.2f}",
        "high / high": "{high:.2f}",
    }),
    "pareto.means": pareto_means,
    "pareto.scenes": pareto_scenes,
}  # fmt: skip
