"""The stub wive/_cpu.pyi says what the compiled module has: the same names, the same arguments."""

import ast
import re
from pathlib import Path

import pytest

import wive
from wive import _cpu

STUB = ast.parse((Path(wive.__file__).parent / "_cpu.pyi").read_text())
# What pybind11 gives every class, and Python every object.
OF_EVERY_CLASS = set(dir(type("Empty", (), {}))) | {"_pybind11_conduit_v1_"}

Signatures = dict[str, list[list[str]] | None]  # of each name; None if it is no function


def of_stub(body: list[ast.stmt]) -> Signatures:
    """The functions, properties and attributes that the stub declares, functions with their arguments."""
    found: Signatures = {}
    for statement in body:
        if isinstance(statement, ast.FunctionDef) and not statement.decorator_list:
            found[statement.name] = [[argument.arg for argument in statement.args.args]]
        elif isinstance(statement, ast.FunctionDef | ast.ClassDef):
            found[statement.name] = None
        elif isinstance(statement, ast.AnnAssign) and ast.unparse(statement.annotation) != "TypeAlias":
            found[ast.unparse(statement.target)] = None
    return found


def of_module(names: set[str], owner: object) -> Signatures:
    """What the compiled module has, functions with the arguments of each overload."""
    return {name: overloads(name, getattr(owner, name)) for name in names}


def overloads(name: str, member: object) -> list[list[str]] | None:
    if isinstance(member, type) or not callable(member):
        return None
    lines = re.findall(rf"^(?:\d+\. )?{name}\((.*)\) -> ", member.__doc__ or "", re.MULTILINE)
    return [list(arguments(line)) for line in lines if line != "*args, **kwargs"]


def arguments(line: str) -> list[str]:
    """The names in "self: Bvh, rays: tuple[int, int] = (1, 2)": words before a colon outside brackets."""
    depth, names = 0, []
    for part in re.findall(r"[\[({]|[\])}]|\w+: |.", line):
        depth += (part in "[({") - (part in "])}")
        if depth == 0 and part.endswith(": "):
            names.append(part[:-2])
    return names


def assert_same(stub: Signatures, compiled: Signatures) -> None:
    assert stub.keys() == compiled.keys()
    for name, declared in stub.items():
        found = compiled[name]
        assert (declared is None) == (found is None), name
        if declared is not None and found is not None:
            assert found, f"{name} has no signature in its docstring"
            for overload in found:
                assert overload == declared[0], name


def classes() -> list[ast.ClassDef]:
    return [statement for statement in STUB.body if isinstance(statement, ast.ClassDef)]


def test_the_module_has_what_the_stub_declares_and_nothing_else() -> None:
    names = {name for name in vars(_cpu) if not name.startswith("_")}
    assert_same(of_stub(STUB.body), of_module(names, _cpu))


@pytest.mark.parametrize("declared", classes(), ids=lambda declared: declared.name)
def test_classes_have_what_the_stub_declares_and_nothing_else(declared: ast.ClassDef) -> None:
    owner = getattr(_cpu, declared.name)
    names = {"__init__"} | (set(vars(owner)) - OF_EVERY_CLASS)
    assert_same(of_stub(declared.body), of_module(names, owner))
