"""The entries of a traversal's stack: a child and, if children are visited in order, its distance."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.layout import ALL_BITS
from wive.warp_kernels.lanes.native import STACK_1, STACK_8

# Stores an entry if `stored` is not zero: behind the i-th as many as `below` has bits. On CUDA that takes no
# branch: a thread's own stack is local memory, which has addresses of its own.
_STORE_IF = """
#if defined(__CUDA_ARCH__) && OWN
    wp::uint64 address = (wp::uint64)words;
    asm("cvta.to.local.u64 %0, %0;" : "+l"(address));
    asm volatile(
        "{ .reg .pred %%met; .reg .u64 %%entry;"
        " setp.ne.u32 %%met, %0, 0; mad.wide.u32 %%entry, %1, BYTES, %2; @%%met STORE }"
        :: "r"(stored), "r"(__popc(below)), "l"(address + BYTES * (wp::int64)i),
           "r"(child), "r"(__float_as_uint(distance)) : "memory");
#else
    if (stored != 0u) {
        word_of_stack* const entry = words + WORDS * (i + (int)wp::bit_count(below));
        entry[0] = child;
        if (WORDS == 2) entry[1] = wp::cast<wp::uint32>(distance);
    }
#endif
"""
_STORES = {1: "st.local.u32 [%%entry], %3;", 2: "st.local.v2.u32 [%%entry], {%3, %4};"}
_WORD = "    return *(word_of_stack*)((char*)words + BYTES * (wp::int64)i + 4 * PART);\n"


def entries_of(lanes: SimpleNamespace, in_order: bool) -> SimpleNamespace:
    """Functions on entries of a lane form's stack, which is made up of them from its first word on.

    words: of an entry. open(stack): the entry at the bottom, which is always near enough to be popped, and
    whose child ends the traversal. child, distance: of the i-th entry. store_if(stack, i, below, stored,
    child, distance): if `stored` is not zero, the entry that is as many behind the i-th as `below` has bits.
    """
    words = 2 if in_order else 1
    stack_argument = lanes.stack_argument

    def native(code: str) -> str:
        values = {"STORE": _STORES[words], "BYTES": 4 * words, "WORDS": words, "OWN": int(lanes.length == 8)}
        for name, value in values.items():
            code = code.replace(name, str(value))
        return code

    stack_code = STACK_8 if lanes.length == 8 else STACK_1

    @wp.func_native(native(stack_code + _STORE_IF))
    def store_if(
        stack: stack_argument, i: int, below: wp.uint32, stored: wp.uint32, child: wp.uint32, distance: float
    ): ...

    @wp.func_native(native(stack_code + _WORD.replace("PART", "0")))
    def load_child(stack: stack_argument, i: int) -> wp.uint32: ...

    @wp.func_native(native(stack_code + _WORD.replace("PART", "1")))
    def load_distance(stack: stack_argument, i: int) -> wp.uint32: ...

    @without_gradient
    @wp.func
    def child(stack: stack_argument, i: int):
        return wp.cast(load_child(stack, i), wp.int32)

    @without_gradient
    @wp.func
    def distance(stack: stack_argument, i: int):
        return wp.cast(load_distance(stack, i), wp.float32)

    store_word = lanes.store_word

    @without_gradient
    @wp.func
    def open(stack: stack_argument):
        store_word(stack, 0, ALL_BITS)
        if wp.static(in_order):
            store_word(stack, 1, wp.cast(-wp.inf, wp.uint32))

    for function in (store_if, load_child, load_distance):
        without_gradient(function)
    return SimpleNamespace(
        words=words,
        open=open,
        store_if=store_if,
        child=child,
        distance=distance,
    )
