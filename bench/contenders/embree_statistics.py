"""Embree's own statistics of a tree: SAH cost, bytes, nodes, and the traversal kernel it chose.

Embree prints them to standard output (`verbose=2`) and has no call that returns them, so the tree is built in
another process, whose output is parsed.
"""

import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.contenders.compiled_shim import BenchError
from bench.contenders.native_embree import EmbreeMesh, Isa, Quality
from bench.support.scenes import Mesh
from bench.support.timing import core_count


@dataclass(frozen=True)
class TreeStatistics:
    """Statistics of one tree. SAH costs count inner nodes and triangle blocks, relative to the root."""

    sah_inner: float
    sah_leaves: float
    bytes_per_triangle: float
    inner_nodes: int
    depth: int
    intersector: str


PATTERNS = {
    "sah_inner": r"getAABBNodes\s*: sah =\s*([\d.]+)",
    "sah_leaves": r"leaves\s*: sah =\s*([\d.]+)",
    "bytes_per_triangle": r"total\s*: sah = .*#bytes/prim =\s*([\d.]+)",
    "inner_nodes": r"getAABBNodes\s*: .*#nodes =\s*(\d+)",
    "depth": r"depth = (\d+)",
    "intersector": r"selected scene intersector\s+intersector1\s*= (\S+)",
}


def embree_statistics(mesh: Mesh, *, isa: Isa, robust: bool, quality: Quality = "medium") -> TreeStatistics:
    """Statistics of the mesh's tree, built in another process."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.npz"
        np.savez(path, vertices=mesh.vertices, faces=mesh.faces)
        answer = subprocess.run(
            [sys.executable, "-m", __name__, str(path), isa, str(int(robust)), quality],
            cwd=Path(__file__).resolve().parents[2], capture_output=True, text=True, check=False,
        )  # fmt: skip
    return parse(answer.stdout, mesh.name, answer.stderr)


def parse(printed: str, name: str, complaint: str = "") -> TreeStatistics:
    """The statistics in Embree's output; BenchError if one is missing."""
    found: dict[str, str] = {}
    for key, pattern in PATTERNS.items():
        match = re.search(pattern, printed)
        if match is None:
            last = (complaint.strip().splitlines() or ["nothing on standard error"])[-1]
            raise BenchError(f"Embree's statistics for {name} lack {key}: {last}")
        found[key] = match.group(1)
    return TreeStatistics(
        sah_inner=float(found["sah_inner"]),
        sah_leaves=float(found["sah_leaves"]),
        bytes_per_triangle=float(found["bytes_per_triangle"]),
        inner_nodes=int(found["inner_nodes"]),
        depth=int(found["depth"]),
        intersector=found["intersector"],
    )


def _build_verbosely(path: str, isa: Isa, robust: bool, quality: Quality) -> None:
    with np.load(path) as arrays:
        vertices, faces = arrays["vertices"], arrays["faces"]
    threads = core_count()
    with EmbreeMesh(
        vertices, faces, isa=isa, robust=robust, threads=threads, quality=quality, verbose=2
    ) as tree:
        tree.commit()


if __name__ == "__main__":
    _build_verbosely(sys.argv[1], sys.argv[2], sys.argv[3] == "1", sys.argv[4])  # type: ignore[arg-type]
