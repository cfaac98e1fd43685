"""Folders include one way: python -> render -> kernels -> build, traverse -> core; warp_kernels likewise."""

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# What each room of cpu/ may include, besides itself.
ROOMS = {
    "core": set(),
    "build": {"core"},
    "traverse": {"core"},
    "kernels": {"build", "traverse", "core"},
    "render": {"kernels", "build", "traverse", "core"},
    "python": {"render", "kernels", "build", "traverse", "core"},
}
# Each room of warp_kernels/ imports itself and those before it; the last one also the package's public names.
WARP_ROOMS = ("lanes", "tree", "queries", "triangles", "traversal", "launching", "functions", "scene")
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)


def includes() -> Iterator[tuple[str, str]]:
    """Every file of cpu/ with each file of it that it includes, as paths from cpu/."""
    cpu = ROOT / "cpu"
    for file in sorted(path for path in cpu.rglob("*") if path.suffix in (".h", ".cpp", ".inc", ".in")):
        for target in INCLUDE.findall(file.read_text()):
            if (cpu / target).exists():
                yield file.relative_to(cpu).as_posix(), target
            else:  # made by CMake
                assert list(cpu.rglob(f"{target}.in")), f"{file}: no {target} in cpu/"


def imports(package: Path, name: str) -> Iterator[tuple[str, str]]:
    """Every module of a package with each module of it that it imports when it is imported itself."""
    modules = {
        ".".join((name, *path.relative_to(package).with_suffix("").parts)).removesuffix(".__init__"): path
        for path in package.rglob("*.py")
    }
    for module, path in sorted(modules.items()):
        for statement in top_level(ast.parse(path.read_text()).body):
            if isinstance(statement, ast.Import):
                found = [alias.name for alias in statement.names]
            else:
                found = [f"{statement.module}.{alias.name}" for alias in statement.names]
            for target in found:
                target = target if target in modules else target.rpartition(".")[0]
                if target in modules:
                    yield module, target


def top_level(body: list[ast.stmt]) -> Iterator[ast.Import | ast.ImportFrom]:
    """Import statements that run with the module; those for type checkers alone don't."""
    for statement in body:
        if isinstance(statement, (ast.Import, ast.ImportFrom)):
            yield statement
        elif isinstance(statement, (ast.If, ast.Try)) and "TYPE_CHECKING" not in ast.dump(statement):
            yield from top_level(statement.body)


def assert_no_circles(arrows: list[tuple[str, str]]) -> None:
    graph: TopologicalSorter[str] = TopologicalSorter()
    for source, target in arrows:
        graph.add(source, target)
    graph.prepare()  # raises CycleError, naming the circle


def test_rooms_of_the_core_include_one_way() -> None:
    arrows = list(includes())
    wrong = [
        f"{source} includes {target}"
        for source, target in arrows
        if (room := source.partition("/")[0]) != (other := target.partition("/")[0])
        and other not in ROOMS[room]
    ]
    assert len(arrows) > 100
    assert wrong == []
    assert_no_circles(arrows)


def test_rooms_of_the_warp_kernels_import_one_way() -> None:
    arrows = list(imports(ROOT / "warp_kernels", "wive.warp_kernels"))
    rooms = [(module.split(".")[2:], target.split(".")[2:]) for module, target in arrows]
    wrong = [
        f"{source} imports {target}"
        for source, target in rooms
        if source and WARP_ROOMS.index(source[0]) < WARP_ROOMS.index(target[0] if target else "scene")
    ]
    assert len(arrows) > 50
    assert wrong == []


@pytest.mark.parametrize("folder", ["wive", "warp_kernels"])
def test_modules_import_without_circles(folder: str) -> None:
    name = "wive" if folder == "wive" else f"wive.{folder}"
    arrows = [(module, target) for module, target in imports(ROOT / folder, name) if target != name]
    assert arrows
    assert_no_circles(arrows)
