"""Basic blocks of PTX functions: how long they are, what follows them, and where the lanes of a warp meet."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from bench.ptx.parsing import Function, Instruction, Label, Statement

# Instructions that the assembler removes or folds into others.
FREE = ("cvta", "ld.param", "st.param", "mov.")


@dataclass
class Block:
    """Instructions that follow each other; `after` are the numbers of the blocks that may come next."""

    function: int
    length: int = 0
    after: list[int] = field(default_factory=list)


def blocks_of(functions: Sequence[Function]) -> tuple[list[Block], list[dict[int, int]]]:
    """The blocks of all functions, and per function the number of the block that begins at a statement."""
    blocks: list[Block] = []
    begins: list[dict[int, int]] = []
    for number, function in enumerate(functions):
        starts = {at: len(blocks) + i for i, at in enumerate(_starts(function.body))}
        labels = {
            statement.name: starts[at]
            for at, statement in enumerate(function.body)
            if at in starts
            if isinstance(statement, Label)
        }
        blocks += [Block(number) for _ in starts]
        begins.append(starts)
        current, open_ = None, False
        for at, statement in enumerate(function.body):
            if at in starts:
                if current is not None and open_:
                    blocks[current].after.append(starts[at])
                current, open_ = starts[at], True
            if not isinstance(statement, Instruction) or current is None:
                continue
            blocks[current].length += not statement.opcode.startswith(FREE)
            if statement.opcode.startswith("bra"):
                blocks[current].after.append(labels[statement.operands[0]])
            if statement.opcode.startswith(("bra", "ret")) and not statement.guard:
                open_ = False
    return blocks, begins


def _starts(body: Sequence[Statement]) -> Iterator[int]:
    """The statements at which blocks begin: the first instruction, labels, and what follows a branch."""
    begins = True
    for at, statement in enumerate(body):
        if isinstance(statement, Label) or (begins and isinstance(statement, Instruction)):
            yield at
            begins = False
        if isinstance(statement, Instruction) and statement.opcode.startswith("bra"):
            begins = True


def meeting_places(blocks: Sequence[Block]) -> list[int]:
    """Where paths from each block meet again; the number of blocks is the end.

    As compilers place it: at the first block that all paths pass, in the innermost loop that holds them. The
    loop's header counts as the end of an iteration; lanes that leave the loop wait behind it.
    """
    end = len(blocks)
    loops = sorted(_loops(blocks).items(), key=lambda loop: len(loop[1]))
    everywhere = _meetings(blocks, set(range(end)), end)
    within = {header: _meetings(blocks, body, header) for header, body in loops}
    places = []
    for number, block in enumerate(blocks):
        inner = (h for h, body in loops if number in body and all(n in body for n in block.after))
        header = next(inner, None)
        places.append(everywhere[number] if header is None else within[header][number])
    return places


def _loops(blocks: Sequence[Block]) -> Mapping[int, set[int]]:
    """The blocks of each natural loop, by its header."""
    before: list[list[int]] = [[] for _ in blocks]
    for number, block in enumerate(blocks):
        for after in block.after:
            before[after].append(number)
    entries = {
        number
        for number, block in enumerate(blocks)
        if number == 0 or blocks[number - 1].function != block.function
    }
    dominators: list[set[int] | None] = [
        {number} if number in entries else None for number in range(len(blocks))
    ]
    changed = True
    while changed:
        changed = False
        for number in range(len(blocks)):
            known = [found for b in before[number] if (found := dominators[b]) is not None]
            if number in entries or not known:
                continue
            new = set.intersection(*known) | {number}
            if new != dominators[number]:
                dominators[number], changed = new, True
    loops: dict[int, set[int]] = {}
    for number, block in enumerate(blocks):
        for header in block.after:
            if header in (dominators[number] or ()):
                body = loops.setdefault(header, {header})
                todo = [number]
                while todo:
                    one = todo.pop()
                    if one not in body:
                        body.add(one)
                        todo += before[one]
    return loops


def _meetings(blocks: Sequence[Block], nodes: set[int], final: int) -> dict[int, int]:
    """The nearest block that all paths from each of the nodes to `final` pass."""
    passed: dict[int, set[int]] = {}
    changed = True
    while changed:
        changed = False
        for number in sorted(nodes, reverse=True):
            after = blocks[number].after or [final]
            known = [
                {final} if n == final else passed[n]
                for n in after
                if n == final or (n in nodes and n in passed)
            ]
            if not known:
                continue
            new = set.intersection(*known) | {number}
            if new != passed.get(number):
                passed[number], changed = new, True
    # Of the blocks passed, the nearest passes all others itself.
    places = {}
    for number in nodes:
        later = passed.get(number, set()) - {number, final}
        places[number] = max(later, key=lambda n: len(passed[n]), default=final)
    return places
