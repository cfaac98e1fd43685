// One instruction set's kernels of closest points. CMakeLists.txt compiles this file once per instruction set, with
// that instruction set's flags, WIVE_ISA (the instruction set and namespace) and WIVE_SIMD (its wrapper types).
#include WIVE_SIMD

#include "kernels/closest_kernels.h"
#include "traverse/closest_point.h"
#include "traverse/compressed_slabs.h"
#include "traverse/float64.h"
#include "traverse/slabs.h"

namespace wive {
namespace WIVE_ISA {
namespace {

template <class I>
constexpr ClosestKernels<typename I::Real> make_kernels() {
    using Real = typename I::Real;
    return {{find_closest<I, Float32Layout<Real>, false>, find_closest<I, CompressedLayout<Real>, false>},
            {find_closest<I, Float32Layout<Real>, true>, find_closest<I, CompressedLayout<Real>, true>}};
}

constexpr ClosestKernels<float> of_floats = make_kernels<ThisIsa>();
constexpr ClosestKernels<double> of_doubles = make_kernels<Float64<ThisIsa>>();

}  // namespace
}  // namespace WIVE_ISA

template <>
const ClosestKernels<float>* closest_kernels<IsaName::WIVE_ISA, float>() {
    return &WIVE_ISA::of_floats;
}
template <>
const ClosestKernels<double>* closest_kernels<IsaName::WIVE_ISA, double>() {
    return &WIVE_ISA::of_doubles;
}

}  // namespace wive
