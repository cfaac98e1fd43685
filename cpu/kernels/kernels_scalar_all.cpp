#include "kernels/kernel_table.h"
#include "traverse/compressed_slabs.h"
#include "traverse/simd_scalar.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<float> table = make_kernel_table<Scalar, FullSlabs, CompressedSlabs, all_hits>("scalar");
const KernelTable<float>* scalar_all_hits() { return &table; }
}  // namespace wive
