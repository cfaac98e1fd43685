#include "kernels/kernels.h"

#if defined(__AVX512F__)
#include "kernels/kernel_table.h"
#include "traverse/compressed_slabs.h"
#include "traverse/simd_avx512.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<float> table =
    make_kernel_table<Avx512, FullSlabs, CompressedSlabs, all_hits>("avx512.full");
const KernelTable<float>* avx512_full_all_hits() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<float>* avx512_full_all_hits() { return nullptr; }
}  // namespace wive
#endif
