// Kernels that sort the children hit by their true entry distance: closest hits in float32 trees, fast and watertight.
// Compiled once per instruction set, with WIVE_ISA and WIVE_DISTANCE, as cpu/kernels/kernels_part.cpp is.
#include WIVE_DISTANCE

#include "kernels/kernel_table.h"
#include "kernels/trace.h"
#include "traverse/slabs.h"

namespace wive::WIVE_ISA {
namespace {

constexpr bool is_compared(KernelChoice choice) {
    return choice.query == QueryKind::closest && choice.accuracy != Accuracy::exact;
}

constexpr KernelTable<float> table = make_kernel_table<ByDistance, FullSlabs, NoSlabs, is_compared>();

}  // namespace
}  // namespace wive::WIVE_ISA

#define WIVE_JOIN(a, b) a##b
#define WIVE_NAME(isa) WIVE_JOIN(study_trace_, isa)

// Traces on one thread. units, center, extent: those of the tree. tmin and tmax hold one value for all rays.
extern "C" void WIVE_NAME(WIVE_ISA)(const std::byte* units, const float* center, const float* extent, int accuracy,
                                    const float* origins, const float* directions, const float* tmin, const float* tmax,
                                    std::size_t count, float* t, std::int32_t* prim, float* uv, std::int32_t* stats,
                                    unsigned in_flight) {
    using namespace wive;
    BvhView bvh = {units, {}, {}, 0};
    for (int axis = 0; axis < 3; ++axis) {
        bvh.center[axis] = center[axis];
        bvh.extent[axis] = extent[axis];
    }
    HitBatch<float> hits;
    hits.t = t;
    hits.prim = prim;
    hits.uv = uv;
    hits.stats = stats;
    const KernelTable<float>& table = WIVE_ISA::table;
    const KernelChoice choice = {QueryKind::closest, static_cast<Accuracy>(accuracy), NodeForm::float32,
                                 stats != nullptr};
    trace(table, table.kernels[kernel_index(choice)], bvh, {origins, directions, tmin, tmax, 0, 0}, hits, count, 1,
          in_flight);
}
