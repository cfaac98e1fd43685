#include "compressed_slabs.h"
#include "kernel_table.h"
#include "simd_scalar.h"
#include "slabs.h"

namespace wive {
static constexpr KernelTable<float> stored = make_kernel_table<Scalar, FullSlabs, CompressedSlabs>("scalar");
static constexpr KernelTable<float> by_distance = make_kernel_table<ScalarByDistance, FullSlabs>("scalar.distance");
const KernelTable<float>* scalar_kernels() { return &stored; }
const KernelTable<float>* scalar_by_distance_kernels() { return &by_distance; }
}  // namespace wive
