#include "kernels/kernel_table.h"
#include "traverse/compressed_slabs.h"
#include "traverse/float64.h"
#include "traverse/simd_scalar.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<double> table =
    make_kernel_table<Float64<Scalar>, FullSlabs, CompressedSlabs, everything>("scalar");
const KernelTable<double>* scalar_float64_kernels() { return &table; }
}  // namespace wive
