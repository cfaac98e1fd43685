#include "kernels/kernel_table.h"
#include "traverse/compressed_slabs.h"
#include "traverse/simd_scalar.h"
#include "traverse/slabs.h"

namespace wive {
static constexpr KernelTable<float> stored =
    make_kernel_table<Scalar, FullSlabs, CompressedSlabs, first_hits>("scalar");
static constexpr KernelTable<float> by_distance =
    make_kernel_table<ScalarByDistance, FullSlabs, NoSlabs, closest_inexact>("scalar.distance");
const KernelTable<float>* scalar_first_hits() { return &stored; }
const KernelTable<float>* scalar_by_distance_kernels() { return &by_distance; }
}  // namespace wive
