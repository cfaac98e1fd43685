// The compiled kernels, one table an instruction set and form.
#pragma once

#include <string_view>

#include "layout.h"
#include "ray.h"

namespace wive {

// One thread's share of a batch: rays come from the source until it is empty. in_flight rays are traced in turns;
// 1 is plain single-ray traversal. scratch: in_flight * flight_bytes of 64-byte aligned memory where it is above 1.
using TraceBatch = void (*)(const BvhView&, const RayBatch&, const HitBatch&, const RaySource&, unsigned in_flight,
                            std::byte* scratch);

struct KernelTable {
    std::string_view name;
    std::size_t flight_bytes;
    // Indexed by accuracy, then by whether steps are counted. A null pointer: not made for this table.
    TraceBatch closest[accuracy_count][2];
    TraceBatch any[accuracy_count][2];
};

// Null where this build has no such kernels; whether the machine can run them is dispatch.h's business.
const KernelTable* avx512_full_kernels();
const KernelTable* avx512_half_kernels();
const KernelTable* avx2_kernels();
const KernelTable* scalar_kernels();
const KernelTable* scalar_by_distance_kernels();

}  // namespace wive
