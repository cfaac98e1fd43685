"""PTX text as functions and statements; the language: https://docs.nvidia.com/cuda/parallel-thread-execution."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

FUNCTION = re.compile(
    r"\.(?P<kind>func|entry)\s*(?P<result>\([^)]*\))?\s*(?P<name>[\w$]+)\s*\((?P<parameters>[^)]*)\)"
    r"(?:\s*\.\w+ \d+)*\s*\{"
)
PARAMETER = re.compile(r"([\w$]+)(?:\[\d+\])?\s*$")
INSTRUCTION = re.compile(r"(?:@(?P<not>!?)%(?P<guard>\w+)\s+)?(?P<opcode>\S+)\s*(?P<operands>.*)")
LABEL = re.compile(r"\$?\w+")


@dataclass(frozen=True)
class Instruction:
    """One instruction: what guards it, its opcode such as "add.rn.f32", its operands."""

    text: str
    guard: str  # a predicate register, or empty
    negated: bool
    opcode: str
    operands: tuple[str, ...]


@dataclass(frozen=True)
class Label:
    """A place that branches name."""

    name: str


@dataclass(frozen=True)
class Declaration:
    """Registers, or memory of a function: the text behind its first dot."""

    text: str


@dataclass(frozen=True)
class Brace:
    """Begins or ends a block of declarations."""

    text: str


Statement = Instruction | Label | Declaration | Brace


@dataclass(frozen=True)
class Function:
    """A function or a kernel, with its parameters: first the one that takes its result, if it has one."""

    name: str
    is_kernel: bool
    parameters: tuple[str, ...]
    body: tuple[Statement, ...]


def functions_of(ptx: str) -> Iterator[Function]:
    """The functions that PTX text defines."""
    text = re.sub(r"//[^\n]*", "", ptx)
    for match in FUNCTION.finditer(text):
        result = re.findall(r"[\w$]+(?=(?:\[\d+\])?\s*\))", match["result"] or "")
        named = (PARAMETER.search(part) for part in match["parameters"].split(","))
        parameters = (*result, *(name[1] for name in named if name))
        body = text[match.end() : _closing_brace(text, match.end())]
        yield Function(match["name"], match["kind"] == "entry", parameters, tuple(_statements(body)))


def split_operands(text: str) -> tuple[str, ...]:
    """The parts between commas that are not in brackets, parentheses or braces."""
    parts = re.findall(r"(?:[^,\[({]|\[[^\]]*\]|\([^)]*\)|\{[^}]*\})+", text)
    return tuple(part.strip() for part in parts)


def _closing_brace(text: str, at: int) -> int:
    depth = 1
    for brace in re.compile(r"[{}]").finditer(text, at):
        depth += 1 if brace[0] == "{" else -1
        if depth == 0:
            return brace.start()
    raise ValueError("PTX: a brace is not closed")


def _statements(body: str) -> Iterator[Statement]:
    statement = ""
    for piece in re.split(r"([;:{}])", body):
        held = statement.strip()
        if piece == ";":
            yield _statement(" ".join(held.split()))
            statement = ""
        elif piece == ":" and LABEL.fullmatch(held):
            yield Label(held)
            statement = ""
        elif piece and piece in "{}" and not held:
            yield Brace(piece)
        else:
            statement += piece


def _statement(text: str) -> Statement:
    if text.startswith("."):
        return Declaration(text[1:])
    match = INSTRUCTION.fullmatch(text)
    if match is None:
        raise ValueError(f"PTX: not a statement: {text}")
    operands = split_operands(match["operands"])
    return Instruction(text, match["guard"] or "", bool(match["not"]), match["opcode"], operands)
