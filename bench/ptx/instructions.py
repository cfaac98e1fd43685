"""What PTX instructions compute, as C++ expressions of their operands.

In an expression {a}, {b}, {c} and {d} are the operands and {T} is the type that ends the opcode. An opcode
that is not here is refused, in particular those that round otherwise or flush subnormal numbers to zero.
"""

import re
from typing import NamedTuple

TYPES = {
    "pred": "bool", "f32": "float", "f64": "double",
    "b8": "std::uint8_t", "b16": "std::uint16_t", "b32": "std::uint32_t", "b64": "std::uint64_t",
    "u8": "std::uint8_t", "u16": "std::uint16_t", "u32": "std::uint32_t", "u64": "std::uint64_t",
    "s8": "std::int8_t", "s16": "std::int16_t", "s32": "std::int32_t", "s64": "std::int64_t",
}  # fmt: skip
SIZES = {name: 1 if name == "pred" else int(name[1:]) // 8 for name in TYPES}


class Rule(NamedTuple):
    """An instruction's expression; empty types are the one that ends the opcode."""

    expression: str
    operands: tuple[str, ...] = ("", "", "", "")
    result: str = ""


SHIFT = ("", "u32")
RULES = {
    "abs": Rule("std::abs({a})"),
    "add": Rule("{a} + {b}"),
    "add.rn": Rule("{a} + {b}"),
    "and": Rule("{a} & {b}"),
    "atom.add": Rule("add_to<{T}>({a}, {b})", ("address", "")),
    "atom.global.add": Rule("add_to<{T}>({a}, {b})", ("address", "")),
    "bfi": Rule("insert_bits<{T}>({a}, {b}, {c}, {d})", ("", "", "u32", "u32")),
    "bfind.shiftamt": Rule("places_to_top({a})", result="u32"),
    "brev": Rule("reversed({a})"),
    "clz": Rule("leading_zeros({a})", result="u32"),
    "div": Rule("{a} / {b}"),
    "div.rn": Rule("{a} / {b}"),
    "fma.rn": Rule("std::fma({a}, {b}, {c})"),
    "mad.lo": Rule("{a} * {b} + {c}"),
    "max": Rule("larger({a}, {b})"),
    "min": Rule("smaller({a}, {b})"),
    "mov": Rule("{a}"),
    "mul": Rule("{a} * {b}"),
    "mul.lo": Rule("{a} * {b}"),
    "mul.rn": Rule("{a} * {b}"),
    "neg": Rule("-{a}"),
    "not": Rule("~{a}"),
    "or": Rule("{a} | {b}"),
    "popc": Rule("__builtin_popcountll({a})", result="u32"),
    "prmt": Rule("permuted_bytes({a}, {b}, {c})"),
    "rcp.rn": Rule("1 / {a}"),
    "rem": Rule("{a} % {b}"),
    "selp": Rule("{c} ? {a} : {b}", ("", "", "pred")),
    "shf.l.wrap": Rule("funnel_left({a}, {b}, {c})", ("u32", "u32", "u32")),
    "shl": Rule("shift_left<{T}>({a}, {b})", SHIFT),
    "shr": Rule("shift_right<{T}>({a}, {b})", SHIFT),
    "shfl.sync.bfly": Rule("shuffle<true>({site}, {d}, {a}, {b}, {c})", ("u32", "u32", "u32", "u32")),
    "shfl.sync.idx": Rule("shuffle<false>({site}, {d}, {a}, {b}, {c})", ("u32", "u32", "u32", "u32")),
    "sqrt.rn": Rule("std::sqrt({a})"),
    "sub": Rule("{a} - {b}"),
    "sub.rn": Rule("{a} - {b}"),
    "vote.sync.ballot": Rule("ballot({site}, {b}, {a})", ("pred", "u32")),
    "xor": Rule("{a} ^ {b}"),
}
LOGICAL_NOT = Rule("!{a}")

# With a NaN the first eight are false and those that end in u, unordered, are true.
COMPARISONS = {
    "eq": "{a} == {b}", "ne": "{a} < {b} || {a} > {b}", "lt": "{a} < {b}", "le": "{a} <= {b}",
    "gt": "{a} > {b}", "ge": "{a} >= {b}",
    "equ": "!({a} < {b} || {a} > {b})", "neu": "!({a} == {b})", "ltu": "!({a} >= {b})", "leu": "!({a} > {b})",
    "gtu": "!({a} <= {b})", "geu": "!({a} < {b})",
}  # fmt: skip
WIDER = {"u16": "u32", "s16": "s32", "u32": "u64", "s32": "s64"}


def rule_of(opcode: str) -> tuple[Rule, str]:
    """The rule of an opcode that computes a value, and the type that ends it; ValueError if there is none."""
    stem, _, kind = opcode.rpartition(".")
    if opcode == "not.pred":
        return LOGICAL_NOT, kind
    if stem in RULES:
        return RULES[stem], kind
    if stem in ("mul.wide", "mad.wide"):
        wide = WIDER[kind]
        product = f"{TYPES[wide]}({{a}}) * {TYPES[wide]}({{b}})"
        if stem == "mul.wide":
            return Rule(product, result=wide), kind
        return Rule(f"{product} + {{c}}", ("", "", wide), result=wide), kind
    if stem.startswith("setp.") and stem[5:] in COMPARISONS:
        return Rule(COMPARISONS[stem[5:]], result="pred"), kind
    if stem.startswith("setp.") and stem.endswith(".or") and stem[5:-3] in COMPARISONS:
        return Rule(f"({COMPARISONS[stem[5:-3]]}) || {{c}}", ("", "", "pred"), result="pred"), kind
    conversion = _conversion(opcode)
    if conversion is None:
        raise ValueError(f"PTX: unknown instruction {opcode}")
    return conversion, kind


def _conversion(opcode: str) -> Rule | None:
    """cvt between integers and to wider numbers, or rounding to nearest, as C++ does."""
    match = re.fullmatch(r"cvt(?:\.(?P<rounding>\w+))?\.(?P<to>[usf]\d+)\.(?P<source>[usf]\d+)", opcode)
    if match is None:
        return None
    to, source = match["to"], match["source"]
    to_float, from_float = to.startswith("f"), source.startswith("f")
    exact = not to_float or (from_float and SIZES[to] >= SIZES[source])
    if (from_float and not to_float) or match["rounding"] != (None if exact else "rn"):
        return None
    return Rule(f"{TYPES[to]}({{a}})", result=to)
