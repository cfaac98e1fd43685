"""What this build of the core can do, asked of the core itself."""

from typing import Any, Literal

from bench.contenders.compiled_shim import BenchError
from bench.support.scenes import Mesh
from wive import _cpu

Accuracy = Literal["fast", "watertight"]

NODES = ("float32", "compressed")
QUALITIES = ("medium", "high")


def takes(function: object, argument: str) -> bool:
    """Whether a function of the core has an argument of that name: pybind11 lists them in the docstring."""
    return f" {argument}:" in (function.__doc__ or "")


def node_forms(asked: tuple[str, ...]) -> tuple[str, ...]:
    """The node forms asked for, or all that this build has; BenchError for one that it lacks."""
    return _options("nodes", NODES, asked)


def qualities(asked: tuple[str, ...]) -> tuple[str, ...]:
    """The build qualities asked for, or all that this build has; BenchError for one that it lacks."""
    return _options("quality", QUALITIES, asked)


def _options(argument: str, known: tuple[str, ...], asked: tuple[str, ...]) -> tuple[str, ...]:
    built = known if takes(_cpu.Bvh.__init__, argument) else known[:1]
    for name in asked:
        if name not in built:
            raise BenchError(f"this build has no {argument}={name!r}: {', '.join(built)}")
    return asked or built


def build_tree(
    mesh: Mesh, accuracy: Accuracy, *, nodes: str = "float32", quality: str = "medium", threads: int = 0
) -> _cpu.Bvh:
    """Our tree over a mesh; an option that this build may lack is passed on only where it is used."""
    options: dict[str, Any] = {}
    if nodes != "float32":
        options["nodes"] = nodes
    if quality != "medium":
        options["quality"] = quality
    return _cpu.Bvh(mesh.vertices, mesh.faces, accuracy, threads=threads, **options)
