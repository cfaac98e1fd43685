#include "kernels/kernels.h"

#if defined(__AVX2__)
#include "kernels/kernel_table.h"
#include "traverse/compressed_slabs.h"
#include "traverse/simd_avx2.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<float> table = make_kernel_table<Avx2, FullSlabs, CompressedSlabs, first_hits>("avx2");
const KernelTable<float>* avx2_first_hits() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<float>* avx2_first_hits() { return nullptr; }
}  // namespace wive
#endif
