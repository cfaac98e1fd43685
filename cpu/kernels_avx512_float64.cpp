#include "kernels.h"

#if defined(__AVX512F__)
#include "compressed_slabs.h"
#include "float64.h"
#include "kernel_table.h"
#include "simd_avx512.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<double> table = make_kernel_table<Float64<Avx512>, FullSlabs, CompressedSlabs>("avx512");
const KernelTable<double>* avx512_float64_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<double>* avx512_float64_kernels() { return nullptr; }
}  // namespace wive
#endif
