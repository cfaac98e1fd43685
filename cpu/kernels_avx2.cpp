#include "kernels.h"

#if defined(__AVX2__)
#include "compressed_slabs.h"
#include "kernel_table.h"
#include "simd_avx2.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<float> table = make_kernel_table<Avx2, FullSlabs, CompressedSlabs>("avx2");
const KernelTable<float>* avx2_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<float>* avx2_kernels() { return nullptr; }
}  // namespace wive
#endif
