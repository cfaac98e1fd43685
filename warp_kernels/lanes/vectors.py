"""Operations on whole lane vectors.

On CUDA they are loops, which compilers unroll. On Warp's CPU device they are operations on vectors of its
compiler, Clang, which makes vector code of a loop over lanes only if it finds that the loop can be one.
"""

from typing import Any

import warp as wp

# A vector of Clang, at any address that its numbers may have.
_LANES = """
    typedef wp::REAL __attribute__((vector_size(LENGTH * SIZE), aligned(SIZE), may_alias)) lanes;
"""


def vector_code(code: str, vector: Any) -> str:
    """Native code for a Warp vector: LENGTH and REAL are its own, and LANES declares Clang's `lanes`."""
    length, real = vector._length_, vector._wp_scalar_type_
    values = {
        "LANES": _LANES,
        "LENGTH": str(length),
        "REAL": real.__name__,
        "SIZE": f"sizeof(wp::{real.__name__})",
    }
    for name, value in values.items():
        code = code.replace(name, value)
    return code


def _of_two(cuda: str, host: str) -> str:
    return f"""
    wp::vec_t<LENGTH, wp::REAL> c;
#if defined(__CUDA_ARCH__)
    for (int i = 0; i < LENGTH; ++i) c[i] = {cuda};
#else
    LANES
    const lanes x = *(const lanes*)&a, y = *(const lanes*)&b;
    *(lanes*)&c = {host};
#endif
    return c;
"""


def make_larger(vector: Any) -> wp.Function:
    """The function that returns the larger of two numbers in each lane; of NaN and a number, either."""

    @wp.func_native(vector_code(_of_two("wp::max(a[i], b[i])", "x > y ? x : y"), vector))
    def larger(a: vector, b: vector) -> vector: ...

    return larger


def make_smaller(vector: Any) -> wp.Function:
    """The function that returns the smaller of two numbers in each lane; of NaN and a number, either."""

    @wp.func_native(vector_code(_of_two("wp::min(a[i], b[i])", "x < y ? x : y"), vector))
    def smaller(a: vector, b: vector) -> vector: ...

    return smaller


def make_bits(vector: Any, *comparisons: tuple[str, str, str]) -> wp.Function:
    """The function (low, high, first) that returns a bit for each lane, from bit `first` on.

    It is set if any of the comparisons holds, of "low", "high" or "0". Vectors are of float32.
    """
    length = vector._length_
    # On CUDA without a branch or a selection.
    places = {"0": "0f00000000", "low": "%2", "high": "%3"}
    words = {">=": "ge", "<=": "le", "==": "eq", "<": "lt"}
    steps: list[str] = []
    for a, comparison, b in comparisons:
        more = (".or", ", %%met") if steps else ("", "")
        steps.append(f"setp.{words[comparison]}{more[0]}.f32 %%met, {places[a]}, {places[b]}{more[1]};")
    numbers = {"0": "0.0f", "low": "x", "high": "y"}
    condition = " | ".join(f"({numbers[a]} {comparison} {numbers[b]})" for a, comparison, b in comparisons)
    eight = ", ".join(str(min(i, length)) for i in range(8))  # lanes that are missing are those of zeros
    code = f"""
    unsigned mask = 0u;
#if defined(__CUDA_ARCH__)
    for (int i = 0; i < LENGTH; ++i)
        asm("{{ .reg .pred %%met; {" ".join(steps)} @%%met or.b32 %0, %0, %1; }}"
            : "+r"(mask) : "r"(1u << (first + i)), "f"(low[i]), "f"(high[i]));
#else
    LANES
    typedef bool __attribute__((ext_vector_type(8))) bits;
    const lanes x = *(const lanes*)&low, y = *(const lanes*)&high;
    const auto met = {condition};
    const bits packed = __builtin_convertvector(__builtin_shufflevector(met, met - met, {eight}), bits);
    mask = (unsigned)*(const unsigned char*)&packed << first;
#endif
    return mask;
"""

    @wp.func_native(vector_code(code, vector))
    def bits(low: vector, high: vector, first: int) -> wp.uint32: ...

    return bits
