"""The entries of a traversal's stack: a child and, if children are visited in order, its distance."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.layout import ALL_BITS
from wive.warp_kernels.lanes.native import STACK_1, STACK_8

# Store the child of each slot that has a bit in `hits`: behind the i-th entry as many as the slot's byte of
# `below` has bits.
_STORE = """{
        word_of_stack* const entry = words + WORDS * (i + (int)wp::bit_count(wp::uint32(BEHIND)));
        entry[0] = children[SLOT];
        if (WORDS == 2) entry[1] = wp::cast<wp::uint32>(distances[SLOT]);
    }
"""
# On CUDA a thread alone takes no branch for that: its stack is local memory, which has addresses of its own.
_STORE_HITS_8 = """
#if defined(__CUDA_ARCH__)
    wp::uint64 address = (wp::uint64)words;
    asm("cvta.to.local.u64 %0, %0;" : "+l"(address));
    for (int slot = 0; slot < 8; ++slot)
        asm volatile(
            "{ .reg .pred %%met; .reg .u64 %%entry;"
            " setp.ne.u32 %%met, %0, 0; mad.wide.u32 %%entry, %1, BYTES, %2; @%%met PREDICATED }"
            :: "r"(hits & 1u << slot), "r"(__popc(below[slot / 4] & 255u << 8 * (slot % 4))),
               "l"(address + BYTES * (wp::int64)i),
               "r"(children[slot]), "r"(__float_as_uint(distances[slot])) : "memory");
#else
    const wp::uint64 bytes = (wp::uint64)below[1] << 32 | below[0];
    for (unsigned left = hits; left != 0u; left &= left - 1u) {
        const int slot = __builtin_ctz(left);
        STORE
    }
#endif
""".replace("STORE\n", _STORE.replace("BEHIND", "bytes >> 8 * slot & 255u").replace("SLOT", "slot"))
_STORE_HITS_1 = """
    if ((hits & 1u << lane) != 0u) STORE
""".replace("STORE\n", _STORE.replace("BEHIND", "below[0] & 255u").replace("SLOT", "0"))
_STORES = {1: "st.local.u32 [%%entry], %3;", 2: "st.local.v2.u32 [%%entry], {%3, %4};"}
_WORD = "    return *(word_of_stack*)((char*)words + BYTES * (wp::int64)i + 4 * PART);\n"


def entries_of(lanes: SimpleNamespace, in_order: bool) -> SimpleNamespace:
    """Functions on entries of a lane form's stack, which is made up of them from its first word on.

    words: of an entry. open(stack): the entry at the bottom, which is always near enough to be popped, and
    whose child ends the traversal. child, distance: of the i-th entry. store_hits(stack, i, below, hits,
    children, distances, lane): entries for the slots in `hits`, each as many behind the i-th as the slot's
    byte of `below` has bits.
    """
    words = 2 if in_order else 1
    stack_argument, words_type, vector_type = lanes.stack_argument, lanes.words, lanes.vector

    def native(code: str) -> str:
        values = {"PREDICATED": _STORES[words], "BYTES": 4 * words, "WORDS": words}
        for name, value in values.items():
            code = code.replace(name, str(value))
        return code

    stack_code = STACK_8 if lanes.length == 8 else STACK_1

    @wp.func_native(native(stack_code + (_STORE_HITS_8 if lanes.length == 8 else _STORE_HITS_1)))
    def store_hits(
        stack: stack_argument,
        i: int,
        below: wp.vec2ui,
        hits: wp.uint32,
        children: words_type,
        distances: vector_type,
        lane: int,
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

    for function in (store_hits, load_child, load_distance):
        without_gradient(function)
    return SimpleNamespace(
        words=words,
        open=open,
        store_hits=store_hits,
        child=child,
        distance=distance,
    )
