#include "kernels/kernels.h"

#if defined(__AVX512F__)
#include "kernels/kernel_table.h"
#include "traverse/simd_avx512_distance.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<float> table =
    make_kernel_table<Avx512ByDistance, FullSlabs, NoSlabs, closest_inexact>("avx512.distance");
const KernelTable<float>* avx512_by_distance_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<float>* avx512_by_distance_kernels() { return nullptr; }
}  // namespace wive
#endif
