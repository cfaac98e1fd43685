#include "kernels.h"

#if defined(__AVX2__)
#include "compressed_slabs.h"
#include "float64.h"
#include "kernel_table.h"
#include "simd_avx2.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<double> table = make_kernel_table<Float64<Avx2>, FullSlabs, CompressedSlabs>("avx2");
const KernelTable<double>* avx2_float64_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<double>* avx2_float64_kernels() { return nullptr; }
}  // namespace wive
#endif
