#include "kernels.h"

#if defined(__AVX512F__)
#include "compressed_slabs.h"
#include "half_slabs_avx512.h"
#include "kernel_table.h"
#include "simd_avx512.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<float> full = make_kernel_table<Avx512, FullSlabs, CompressedSlabs>("avx512.full");
static constexpr KernelTable<float> half = make_kernel_table<Avx512, HalfSlabs>("avx512.half");
const KernelTable<float>* avx512_full_kernels() { return &full; }
const KernelTable<float>* avx512_half_kernels() { return &half; }
}  // namespace wive
#else
namespace wive {
const KernelTable<float>* avx512_full_kernels() { return nullptr; }
const KernelTable<float>* avx512_half_kernels() { return nullptr; }
}  // namespace wive
#endif
