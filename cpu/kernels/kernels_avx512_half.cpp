#include "kernels/kernels.h"

#if defined(__AVX512F__)
#include "kernels/kernel_table.h"
#include "traverse/half_slabs_avx512.h"
#include "traverse/simd_avx512.h"

namespace wive {
static constexpr KernelTable<float> table =
    make_kernel_table<Avx512, HalfSlabs, NoSlabs, all_but_counting>("avx512.half");
const KernelTable<float>* avx512_half_kernels() { return &table; }
}  // namespace wive
#else
namespace wive {
const KernelTable<float>* avx512_half_kernels() { return nullptr; }
}  // namespace wive
#endif
