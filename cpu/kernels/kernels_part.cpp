// Some of one instruction set's kernels. CMakeLists.txt compiles this file once per instruction set and part, with that
// instruction set's flags, WIVE_ISA (the instruction set and namespace), WIVE_SIMD (its wrapper types) and WIVE_PART.
#include WIVE_SIMD

#include "kernels/kernel_table.h"
#include "kernels/parts.h"
#include "traverse/compressed_slabs.h"
#include "traverse/float64.h"
#include "traverse/slabs.h"

#if defined(__AVX512F__)
#include "traverse/half_slabs_avx512.h"
#endif

namespace wive {
namespace WIVE_ISA {

template <class Isa>
struct HalfSlabs;  // defined for AVX-512 only

namespace {

template <Part part, class Isa>
constexpr PartTable<part> make_part() {
    if constexpr (part == Part::first_hit)
        return make_kernel_table<Isa, FullSlabs, CompressedSlabs, is_first_hit>();
    else if constexpr (part == Part::multi_hit)
        return make_kernel_table<Isa, FullSlabs, CompressedSlabs, is_multi_hit>();
    else if constexpr (part == Part::float64)
        return make_kernel_table<Float64<Isa>, FullSlabs, CompressedSlabs, every_kernel>();
    else
        return make_kernel_table<Isa, HalfSlabs, NoSlabs, is_without_counters>();
}

constexpr PartTable<Part::WIVE_PART> table = make_part<Part::WIVE_PART, ThisIsa>();

}  // namespace
}  // namespace WIVE_ISA

template <>
const PartTable<Part::WIVE_PART>* part_table<IsaName::WIVE_ISA, Part::WIVE_PART>() {
    return &WIVE_ISA::table;
}

}  // namespace wive
