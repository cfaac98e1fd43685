#include "kernels.h"

#if defined(__AVX512F__)
#include "kernel_table.h"
#include "simd_avx512_distance.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<float> table = make_kernel_table<Avx512ByDistance, FullSlabs>("avx512.distance");
const KernelTable<float>* avx512_by_distance_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<float>* avx512_by_distance_kernels() { return nullptr; }
}  // namespace wive
#endif
