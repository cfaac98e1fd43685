"""The lanes of a node and what they do together: the only code that knows how a ray's lanes lie on threads.

lanes=8: one thread owns all eight lanes as vectors of length eight, and the stack is its own.
lanes=1: eight threads own one lane each. On CUDA they talk by warp intrinsics and share a stack in shared
memory; on Warp's CPU device they are fibers of a block, which run one at a time and change over at a barrier,
so that a static buffer between two barriers is all they need.
"""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import functools
from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.native import (
    ADD_REDUCE,
    DISTANCES_1,
    DISTANCES_8,
    DOUBLE_TRIANGLES_4,
    MIN_REDUCE,
    OR_REDUCE,
    PRODUCT,
    PRODUCTS,
    ROW_1,
    ROW_8,
    SYNC,
    TRIANGLES_4,
    shared_stack_code,
)


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __ffs(lanes) - 1;
#else
    return __builtin_ctz(lanes);
#endif
""")
def lowest_lane(lanes: wp.uint32) -> int:
    """The lowest bit set in lanes, which must not be zero."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __ldg((const float*)units + at);
#else
    return ((const float*)units)[at];
#endif
""")
def load_float(units: wp.uint64, at: int) -> float:
    """One word of the tree as it is."""
    ...


@wp.func_native("""
    const double* number = (const double*)((const float*)units + at);
#if defined(__CUDA_ARCH__)
    return __ldg(number);
#else
    return *number;
#endif
""")
def load_double(units: wp.uint64, at: int) -> wp.float64:
    """The number that two words of the tree hold."""
    ...


@wp.func_native(PRODUCT.replace("ROUNDED", "__fmul_rn"))
def product(a: float, b: float) -> float:
    """a b, rounded."""
    ...


@wp.func_native(PRODUCT.replace("ROUNDED", "__dmul_rn"))
def product_double(a: wp.float64, b: wp.float64) -> wp.float64:
    """a b, rounded."""
    ...


@wp.func_native("return (wp::uint64)units.data;")
def address_of(units: wp.array(dtype=wp.float32)) -> wp.uint64:
    """Where the tree begins: one register to hand on, where the array would be a dozen."""
    ...


def without_gradient(function: wp.Function) -> wp.Function:
    """Keep Warp from building the function's adjoint: with references in its arguments it can't have one."""
    function.is_differentiable = False
    function.adj.skip_reverse_codegen = True
    return function


@wp.func
def _same(x: wp.uint32):
    return x


@wp.func_native(OR_REDUCE)
def _or_of_group(x: wp.uint32) -> wp.uint32: ...


@wp.func_native(MIN_REDUCE)
def _min_of_group(x: wp.uint32) -> wp.uint32: ...


@wp.func_native(ADD_REDUCE)
def _sum_of_group(x: wp.uint32) -> wp.uint32: ...


@wp.func
def _nothing():
    pass


@wp.func_native(SYNC)
def _sync_group(): ...


def reductions(length: int) -> tuple[wp.Function, wp.Function]:
    """The or and the minimum of what each thread of a ray holds, the same for all of them."""
    return (_same, _same) if length == 8 else (_or_of_group, _min_of_group)


def sum_reduction(length: int) -> wp.Function:
    """The sum of what each thread of a ray holds, the same for all of them."""
    return _same if length == 8 else _sum_of_group


@functools.cache
def lanes_of(
    length: int, stack: int, distances: bool, kept: int, precision: str = "float32"
) -> SimpleNamespace:
    """The lane vectors and collectives for vectors of `length` lanes; those of triangles are of `precision`.

    The stack holds `stack` children and, where `distances` is true, as many distances behind them. It is the
    thread's own vector, or the address of the group's piece of memory. Behind all that it has room for `kept`
    words.
    """
    words = stack * (2 if distances else 1) + kept
    return _eight_lanes(words, precision) if length == 8 else _one_lane(words, precision)


def _products_code(length: int, precision: str) -> str:
    """The native code of `products`."""
    rounded = "__fmul_rn" if precision == "float32" else "__dmul_rn"
    return PRODUCTS.replace("LENGTH", str(length)).replace("REAL", precision).replace("ROUNDED", rounded)


def _eight_lanes(stack_words: int, precision: str) -> SimpleNamespace:
    vector = wp.types.vector(length=8, dtype=wp.float32)
    words = wp.types.vector(length=8, dtype=wp.uint32)
    triangles = wp.types.vector(length=4, dtype=getattr(wp, precision))
    stack_type = wp.types.vector(length=stack_words, dtype=wp.uint32)

    @wp.func_native(DISTANCES_8)
    def plane_distances(units: wp.uint64, at: int, lane: int, rdir: float, bias: float) -> vector: ...

    @wp.func_native(ROW_8)
    def load_row(units: wp.uint64, at: int, lane: int) -> words: ...

    @wp.func_native(_products_code(4, precision))
    def products(a: triangles, b: triangles) -> triangles: ...

    @wp.func_native(TRIANGLES_4 if precision == "float32" else DOUBLE_TRIANGLES_4)
    def load_triangles(units: wp.uint64, at: int, lane: int) -> triangles: ...

    @wp.func_native("stack[at] = word;")
    def store_word(stack: wp.ref[stack_type], at: int, word: wp.uint32): ...

    @wp.func_native("return stack[at];")
    def load_word(stack: wp.ref[stack_type], at: int) -> wp.uint32: ...

    return SimpleNamespace(
        length=8,
        block_step=1,
        new_stack=stack_type,
        vector=vector,
        words=words,
        triangles=triangles,
        triangles_length=4,
        plane_distances=plane_distances,
        load_row=load_row,
        load_triangles=load_triangles,
        products=products,
        or_reduce=_same,
        min_reduce=_same,
        sync=_nothing,
        stack_argument=wp.ref[stack_type],
        store_word=without_gradient(store_word),
        load_word=without_gradient(load_word),
    )


def _one_lane(stack_words: int, precision: str) -> SimpleNamespace:
    vector = wp.types.vector(length=1, dtype=wp.float32)
    words = wp.types.vector(length=1, dtype=wp.uint32)
    triangles = wp.types.vector(length=1, dtype=getattr(wp, precision))
    load_number = load_float if precision == "float32" else load_double
    number_words: int = 1 if precision == "float32" else 2

    @wp.func_native(DISTANCES_1)
    def plane_distances(units: wp.uint64, at: int, lane: int, rdir: float, bias: float) -> vector: ...

    @wp.func_native(ROW_1)
    def load_row(units: wp.uint64, at: int, lane: int) -> words: ...

    @wp.func_native(_products_code(1, precision))
    def products(a: triangles, b: triangles) -> triangles: ...

    @wp.func
    def load_triangles(units: wp.uint64, at: int, lane: int):
        return triangles(load_number(units, at + number_words * (lane & 3)))

    @wp.func_native(shared_stack_code(stack_words))
    def shared_stack() -> wp.uint64: ...

    @wp.func_native("((unsigned*)stack)[at] = word;")
    def store_word(stack: wp.uint64, at: int, word: wp.uint32): ...

    @wp.func_native("return ((const unsigned*)stack)[at];")
    def load_word(stack: wp.uint64, at: int) -> wp.uint32: ...

    return SimpleNamespace(
        length=1,
        block_step=2,
        new_stack=shared_stack,
        vector=vector,
        words=words,
        triangles=triangles,
        triangles_length=1,
        plane_distances=plane_distances,
        load_row=load_row,
        load_triangles=load_triangles,
        products=products,
        or_reduce=_or_of_group,
        min_reduce=_min_of_group,
        sync=_sync_group,
        stack_argument=wp.uint64,
        store_word=without_gradient(store_word),
        load_word=without_gradient(load_word),
    )
