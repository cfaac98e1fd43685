#include "kernels/kernels.h"

#if defined(__AVX2__)
#include "kernels/kernel_table.h"
#include "traverse/compressed_slabs.h"
#include "traverse/float64.h"
#include "traverse/simd_avx2.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<double> table =
    make_kernel_table<Float64<Avx2>, FullSlabs, CompressedSlabs, everything>("avx2");
const KernelTable<double>* avx2_float64_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<double>* avx2_float64_kernels() { return nullptr; }
}  // namespace wive
#endif
