#include "kernels/kernels.h"

#if defined(__AVX512F__)
#include "kernels/kernel_table.h"
#include "traverse/compressed_slabs.h"
#include "traverse/float64.h"
#include "traverse/simd_avx512.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<double> table =
    make_kernel_table<Float64<Avx512>, FullSlabs, CompressedSlabs, everything>("avx512");
const KernelTable<double>* avx512_float64_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<double>* avx512_float64_kernels() { return nullptr; }
}  // namespace wive
#endif
