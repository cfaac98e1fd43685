// The parts that the kernels are compiled in: one translation unit per instruction set and part (kernels_part.cpp).
#pragma once

#include <type_traits>

#include "kernels/kernels.h"

namespace wive {

enum class IsaName { scalar, avx2, avx512 };

// first_hit: closest and any hit of float32 scenes; multi_hit: all hits and their number; float64: every query of
// float64 scenes; half: AVX-512's second form of the slab test.
enum class Part { first_hit, multi_hit, float64, half };

template <Part part>
using PartTable = KernelTable<std::conditional_t<part == Part::float64, double, float>>;

// Defined for the pairs in CMakeLists.txt, each in a unit of its own.
template <IsaName isa, Part part>
const PartTable<part>* part_table();

}  // namespace wive
