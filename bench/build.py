"""Building against native Embree, from 100 thousand to 20 million triangles: seconds, SAH cost, bytes.

Wall-clock seconds of wive's constructor and of rtcCommitScene, in turn, at equal numbers of threads and
equal build quality; a ratio above 1 means that wive is faster. Two families of meshes: one piece of terrain
sampled ever finer, and ever more copies of a model side by side. `ns_per_triangle` shows how cost grows:
a constant means linear growth. SAH cost is relative to the root's area, as Embree prints it; bytes count
nodes and leaves.
"""

import argparse
import resource
from collections.abc import Sequence

from bench.contenders.build_race import build_rows, tree_row
from bench.contenders.native_embree import Isa
from bench.support import report
from bench.support.options import QUALITIES, listed, numbers, scene_parser
from bench.support.scenes import SceneFolder
from bench.support.timing import Effort, core_count
from wive import _cpu

# Two families, each from small to large.
USUAL = (
    "terrain_100k", "terrain_400k", "terrain_1600k", "terrain_6400k", "terrain_20000k",
    "bmw_m6_tiled_1x1", "bmw_m6_tiled_2x2", "bmw_m6_tiled_5x5",
)  # fmt: skip
QUICK_SCENES = ("terrain_10k", "terrain_40k")
QUICK_EFFORT = Effort(least=2, most=2)
# Large meshes get fewer rounds, so that each side builds about this many triangles.
TRIANGLES_BUILT = 10_000_000
FEWEST_ROUNDS, MOST_ROUNDS = 3, 15
LARGEST_HIGH = 4_000_000  # triangles; "high" quality takes several times as long to build
MEMORY_LIMIT = 16 << 30  # bytes of address space: an error is better than a machine that swaps

COLUMNS = [
    "scene", "triangles", "quality", "threads", "ratio", "low", "high", "wive_seconds", "embree_seconds",
    "wive_ns_per_triangle", "embree_ns_per_triangle", "rounds",
]  # fmt: skip
TREE_COLUMNS = [
    "scene", "triangles", "quality", "sah_ratio", "wive_sah", "embree_sah", "bytes_ratio", "wive_bytes",
    "embree_bytes", "embree_allocated", "wive_nodes", "embree_nodes", "wive_depth", "embree_depth",
]  # fmt: skip


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, hard))
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, QUICK_SCENES if chosen.quick else USUAL)
    isa: Isa = "avx2" if _cpu.kernels().get("avx512") else "avx512"
    build: list[report.Row] = []
    trees: list[report.Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        rounds = max(FEWEST_ROUNDS, min(MOST_ROUNDS, TRIANGLES_BUILT // len(mesh.faces)))
        effort = QUICK_EFFORT if chosen.quick else Effort(least=min(7, rounds), most=rounds)
        for quality in chosen.quality or QUALITIES:
            if quality == "high" and len(mesh.faces) > LARGEST_HIGH and not chosen.quality:
                continue
            for row in build_rows(mesh, "watertight", isa, chosen.threads, effort, quality):
                for side in ("wive", "embree"):
                    row[f"{side}_ns_per_triangle"] = row[f"{side}_seconds"] / len(mesh.faces) * 1e9
                build.append(row)
                report.print_progress(
                    row, ("scene", "triangles", "quality", "threads", "ratio", "wive_seconds")
                )
            trees.append(tree_row(mesh, "watertight", isa, quality))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    report.print_table(build, COLUMNS, "Building, equal threads: Embree's seconds over wive's")
    report.print_table(
        trees, TREE_COLUMNS, "Trees, wive's over Embree's: SAH relative to the root, bytes per triangle"
    )
    print(f"\npeak memory of this process: {peak:.1f} GiB")
    content = {"isa": isa, "peak_gib": peak, "build": build, "trees": trees}
    whole = scenes.whole and not (chosen.quick or chosen.quality or chosen.threads != default_threads())
    report.save("build", content, chosen.out, whole=whole)


def default_threads() -> tuple[int, ...]:
    """One thread, and one per core."""
    return tuple(dict.fromkeys((1, core_count())))


def _family(row: report.Row) -> str:
    name: str = row["scene"]
    return name.split("_tiled_")[0] if "_tiled_" in name else name.split("_")[0]


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("build", __doc__)
    parser.add_argument(
        "--threads", type=numbers, default=default_threads(), help="numbers of threads, e.g. 1,2"
    )
    parser.add_argument("--quality", type=listed(QUALITIES), default=(), help="build qualities")
    return parser.parse_args(options)
