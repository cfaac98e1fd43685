#include "compressed_slabs.h"
#include "float64.h"
#include "kernel_table.h"
#include "simd_scalar.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<double> table = make_kernel_table<Float64<Scalar>, FullSlabs, CompressedSlabs>("scalar");
const KernelTable<double>* scalar_float64_kernels() { return &table; }
}  // namespace wive
