"""Runs one bench: `python -m bench NAME [options]`."""

import importlib
import sys
from pathlib import Path

# Modules of the commands that have another name.
MODULES = {"convert": "support.convert_scene", "gpu": "gpu.run", "gpu-prepare": "gpu.prepare"}
BENCHES = {
    "build": "build time, SAH cost and memory against native Embree, 100 thousand to 20 million triangles",
    "closest": "closest points and insides against Open3D and trimesh, one core",
    "cliffs": "inputs on which the cost of a ray could jump, over usual ones",
    "dask": "wive.dask on threads and two processes against one call of the scene",
    "embree": "single rays against native Embree: speed, build time, SAH, memory",
    "gpu": "wive's Warp kernels on a GPU: the core's bits, speed against Warp's own query, streams",
    "gpu_model": "what a GPU's warps would do in wive's kernels and Warp's query, without one",
    "inflight": "speed and latency over the rays in flight, and what memory's latency allows",
    "interrupts": "milliseconds until Ctrl-C has ended a call or a command",
    "latency": "seconds per call over batch sizes: every backend, wp.mesh_query_ray, embreex",
    "moving": "one mesh that moves in a scene: refit(geom=), refit, a new scene, a second scene",
    "order": "steps per ray for five orders of visiting a node's children, and their speed",
    "paper": "the WiVe paper's tables: path tracing with its traversals and with Embree's",
    "packets": "pictures from near and far with packets, over the same without",
    "pareto": "speed against leaks, wrong triangles and the error of t, with Embree and Warp",
    "peers": "tinybvh and madmann91/bvh, compiled from their sources, against wive",
    "python": "embreex, trimesh, Warp and wive from Python, NumPy arrays in and out",
    "quality": 'what quality="high" saves in steps per ray and costs in build time',
    "spawn": "spawned origins, points, normals and error bounds over the trace's own time, one core",
    "stream": "rays of files in pieces, to files, over one batch in memory, all cores",
    "gpu-prepare": "not a bench: packs Warp and scenes for a GPU machine without a package index",
    "draw": "not a bench: draws the figures of bench/results again",
    "quote": "not a bench: writes the tables of docs/benchmarks.md from bench/results",
    "convert": "not a bench: makes a scene file of meshes in other formats",
}


def main() -> int:
    """Runs the bench named first on the command line; returns the exit status."""
    _prefer_installed_wive()
    name, *options = sys.argv[1:] or ["--help"]
    if name not in BENCHES:
        if name not in ("-h", "--help"):
            print(f"bench: no bench {name!r}", file=sys.stderr)
        print("usage: python -m bench NAME [--help | options]\n")
        print("\n".join(f"  {known:11} {what}" for known, what in BENCHES.items()))
        return 0 if name in ("-h", "--help") else 2
    from bench.contenders.compiled_shim import BenchError

    try:
        importlib.import_module(f"bench.{MODULES.get(name, name)}").main(options)
    except (BenchError, ImportError, OSError) as problem:
        print(f"bench {name}: {problem}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _prefer_installed_wive() -> None:
    """Puts the source folder, which `-m` puts first, behind the installed wive, which has a compiled core."""
    root = Path(__file__).resolve().parents[1]
    if Path(sys.path[0]).resolve() == root:
        sys.path.append(sys.path.pop(0))


if __name__ == "__main__":
    sys.exit(main())
