#include "compressed_slabs.h"
#include "kernel_table.h"
#include "simd_scalar.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<float> table = make_kernel_table<Scalar, FullSlabs, CompressedSlabs, all_hits>("scalar");
const KernelTable<float>* scalar_all_hits() { return &table; }
}  // namespace wive
