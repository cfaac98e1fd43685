"""PTX functions to C++: one statement per instruction, labels and branches as they are."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from bench.ptx.blocks import Block, blocks_of
from bench.ptx.instructions import SIZES, TYPES, rule_of
from bench.ptx.parsing import (
    Brace,
    Declaration,
    Function,
    Instruction,
    Label,
    Statement,
    functions_of,
    split_operands,
)

SPECIAL = {
    "%tid.x": "thread_index()",
    "%ntid.x": "block.threads",
    "%ctaid.x": "block.index",
    "%nctaid.x": "block.count",
    "%lanemask_lt": "((1u << lane_index()) - 1u)",
    **{f"%{name}.{axis}": "0u" for name in ("tid", "ctaid") for axis in "yz"},
    **{f"%{name}.{axis}": "1u" for name in ("ntid", "nctaid") for axis in "yz"},
}
REGISTERS = re.compile(r"reg \.\w+ (?P<prefix>%?\w+)(?:<(?P<count>\d+)>)?")
MEMORY = re.compile(
    r"(?P<space>local|shared|param) (?:\.align (?P<align>\d+) )?\.(?P<kind>\w+) "
    r"(?P<name>[\w$]+)(?:\[(?P<count>\d+)\])?"
)


@dataclass(frozen=True)
class Program:
    """C++ text that defines `ptx_entry`, and the bytes of shared memory that a block has."""

    text: str
    shared_bytes: int
    blocks: list[Block]


def translate(ptx: str, kernel: str, *, traced: bool = False) -> Program:
    """The program of one kernel in PTX text; if traced, it tells the model its blocks and accesses."""
    functions = [one for one in functions_of(ptx) if not one.is_kernel or one.name == kernel]
    blocks, begins = blocks_of(functions)
    names = {function.name: f"function_{i}" for i, function in enumerate(functions)}
    shared = _Shared()
    for match in re.finditer(rf"^(?:\.\w+ +)*\.{MEMORY.pattern};", ptx, re.MULTILINE):
        shared.declare(match)
    heads, bodies = [], []
    for function, starts in zip(functions, begins, strict=True):
        parameters = ", ".join(f"unsigned char* {_identifier(name)}" for name in function.parameters)
        head = f"static void {names[function.name]}({parameters})"
        body = _Body(names, shared, starts if traced else None).lines(function)
        heads.append(f"{head};")
        bodies.append("\n".join([f"{head} {{", *body, "}"]))
    (entry,) = (function for function in functions if function.is_kernel)
    given = ", ".join(f"const_cast<unsigned char*>(given[{i}])" for i in range(len(entry.parameters)))
    text = "\n".join(
        [
            '#include "machine.h"',
            "using namespace ptx;",
            *heads,
            *bodies,
            f'extern "C" void ptx_entry(const unsigned char* const* given) {{ {names[kernel]}({given}); }}',
        ]
    )
    return Program(text, shared.bytes, blocks)


@dataclass
class _Shared:
    """Where each variable lies in a block's shared memory."""

    offsets: dict[str, int] = field(default_factory=dict)
    bytes: int = 0

    def declare(self, match: re.Match[str]) -> None:
        """Adds the variable of a declaration, which a match of MEMORY gives."""
        unit = SIZES[match["kind"]]
        align = int(match["align"] or unit)
        self.offsets[match["name"]] = -(-self.bytes // align) * align
        self.bytes = self.offsets[match["name"]] + unit * int(match["count"] or 1)


@dataclass(frozen=True)
class _Body:
    """Translates the statements of one function; `starts` are those at which the blocks to be told begin."""

    functions: Mapping[str, str]
    shared: _Shared
    starts: Mapping[int, int] | None

    def lines(self, function: Function) -> Iterable[str]:
        for at, statement in enumerate(function.body):
            done = self._statement(statement)
            told = f"step({self.starts[at]});" if self.starts is not None and at in self.starts else ""
            # A label comes before what belongs to its block.
            yield f"{done} {told}" if isinstance(statement, Label) else f"{told} {done}"

    def _statement(self, statement: Statement) -> str:
        if isinstance(statement, Brace):
            return statement.text
        if isinstance(statement, Label):
            return f"{_identifier(statement.name)}:;"
        if isinstance(statement, Declaration):
            return self._declaration(statement.text)
        done = self._instruction(statement)
        if not statement.guard:
            return done
        return f"if ({'!' if statement.negated else ''}{statement.guard}.get<bool>()) {{ {done} }}"

    def _declaration(self, text: str) -> str:
        if text.startswith("pragma"):
            return ""
        if match := REGISTERS.fullmatch(text):
            prefix, count = _identifier(match["prefix"]), match["count"]
            names = [prefix] if count is None else [f"{prefix}{i}" for i in range(int(count))]
            return f"Register {', '.join(names)};"
        match = MEMORY.fullmatch(text)
        if match is None:
            raise ValueError(f"PTX: unknown declaration .{text}")
        size = SIZES[match["kind"]] * int(match["count"] or 1)
        if match["space"] == "shared":
            self.shared.declare(match)
            return ""
        return f"alignas(16) unsigned char {_identifier(match['name'])}[{size}];"

    def _instruction(self, one: Instruction) -> str:
        opcode, operands = one.opcode, one.operands
        if opcode in ("bra", "bra.uni"):
            return f"goto {_identifier(operands[0])};"
        if opcode == "ret":
            return "return;"
        if opcode == "bar.warp.sync":
            return f"meet(Operation::sync, {_quoted(one.text)}, {self._value(operands[0], 'u32')});"
        if opcode == "call.uni":
            return self._call(operands)
        if opcode.startswith(("ld.", "st.")):
            return self._memory(opcode, operands)
        if opcode.startswith("cvta."):
            return self._pointer(opcode, operands)
        return self._computed(one)

    def _computed(self, one: Instruction) -> str:
        rule, kind = rule_of(one.opcode)
        target, *given = one.operands
        target = target.partition("|")[0]  # a shuffle's second result is not used here
        wanted = (operand or kind for operand in rule.operands)
        values = [self._operand(text, one_kind) for text, one_kind in zip(given, wanted, strict=False)]
        names = dict(zip("abcd", values, strict=False))
        value = rule.expression.format(T=TYPES[kind], site=_quoted(one.text), **names)
        return _assigned(target, rule.result or kind, value)

    def _operand(self, text: str, kind: str) -> str:
        return self._address(text) if kind == "address" else self._value(text, kind)

    def _call(self, operands: tuple[str, ...]) -> str:
        """call (result), function, (arguments): what is in parentheses are names of memory."""
        results, rest = ([], operands) if not operands[0].startswith("(") else ([operands[0]], operands[1:])
        lists = [*results, *rest[1:]]
        given = [_identifier(name) for names in lists for name in split_operands(names[1:-1]) if name]
        return f"{self.functions[rest[0]]}({', '.join(given)});"

    def _memory(self, opcode: str, operands: tuple[str, ...]) -> str:
        kind, loads = opcode.split(".")[-1], opcode.startswith("ld")
        place, values = operands if not loads else reversed(operands)
        names = split_operands(values[1:-1]) if values.startswith("{") else (values,)
        size = SIZES[kind]
        done = [f"unsigned char* const at = aligned({self._address(place, opcode)}, {size * len(names)});"]
        if self.starts is not None and ".param" not in opcode:
            done.append(f"access({'false' if loads else 'true'}, at, {size * len(names)});")
        for i, name in enumerate(names):
            if loads:
                done.append(_assigned(name, kind, f"load<{TYPES[kind]}>(at + {size * i})"))
            else:
                done.append(f"store<{TYPES[kind]}>(at + {size * i}, {self._value(name, kind)});")
        return f"{{ {' '.join(done)} }}"

    def _pointer(self, opcode: str, operands: tuple[str, ...]) -> str:
        """cvta: only pointers to shared memory, which are offsets, differ from the host's."""
        target, source = operands
        value = self._value(source, "u64")
        if opcode == "cvta.shared.u64":
            value = f"reinterpret_cast<std::uint64_t>(block.shared) + static_cast<std::uint32_t>({value})"
        elif opcode not in [f"cvta.{to}{space}.u64" for to in ("", "to.") for space in ("global", "local")]:
            raise ValueError(f"PTX: unknown instruction {opcode}")
        return _assigned(target, "u64", value)

    def _address(self, text: str, opcode: str = "") -> str:
        """The host address of [register+offset] or [variable+offset]."""
        base, _, offset = text[1:-1].partition("+")
        offset = offset or "0"
        if base in self.shared.offsets:
            return f"block.shared + {self.shared.offsets[base]} + {offset}"
        if not base.startswith("%"):
            return f"{_identifier(base)} + {offset}"
        if ".shared" in opcode:
            return f"block.shared + {self._value(base, 'u32')} + {offset}"
        return f"reinterpret_cast<unsigned char*>({self._value(base, 'u64')}) + {offset}"

    def _value(self, text: str, kind: str) -> str:
        """A register, a number or the address of a variable, as a value of that type."""
        as_type = TYPES[kind]
        if text.startswith("{"):  # several registers side by side, the lowest first
            parts = split_operands(text[1:-1])
            width = 8 * SIZES[kind] // len(parts)
            values = (self._value(part, f"u{width}") for part in parts)
            return " | ".join(f"{as_type}({value}) << {width * i}" for i, value in enumerate(values))
        if text in SPECIAL:
            return f"{as_type}({SPECIAL[text]})"
        if text.startswith("%"):
            return f"{_identifier(text)}.get<{as_type}>()"
        if text[:2] in ("0f", "0d"):
            bits = TYPES["u32" if text[1] == "f" else "u64"]
            return f"__builtin_bit_cast({as_type}, {bits}(0x{text[2:]}u))"
        if re.fullmatch(r"-?(?:0x[0-9A-Fa-f]+|\d+)", text):
            return f"{as_type}({int(text, 0) & (1 << 64) - 1}u)"
        if text in self.shared.offsets:
            return f"{as_type}({self.shared.offsets[text]})"
        return f"reinterpret_cast<std::uint64_t>({_identifier(text)})"


def _assigned(target: str, kind: str, value: str) -> str:
    return f"{_identifier(target)}.set<{TYPES[kind]}>({value});"


def _identifier(name: str) -> str:
    """A PTX name as one of C++."""
    return re.sub(r"\W", "_", name.lstrip("%"))


def _quoted(text: str) -> str:
    return '"' + text.replace('"', "'") + '"'
