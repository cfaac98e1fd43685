// The compiled kernels, one table per instruction set and form of the slab test.
#pragma once

#include <array>
#include <initializer_list>
#include <optional>
#include <string_view>

#include "core/layout.h"
#include "core/ray.h"

namespace wive {

enum class QueryKind { closest, any, all, count };
inline constexpr int query_count = 4;

// What a kernel does. Each is compiled for one choice and holds no code for others.
struct KernelChoice {
    QueryKind query;
    Accuracy accuracy;
    NodeForm nodes;
    bool counting;  // steps per ray
};
inline constexpr std::size_t kernel_count = query_count * accuracy_count * node_form_count * 2;

constexpr std::size_t kernel_index(KernelChoice choice) {
    const std::size_t query_and_accuracy =
        static_cast<std::size_t>(choice.query) * accuracy_count + static_cast<std::size_t>(choice.accuracy);
    return (query_and_accuracy * node_form_count + static_cast<std::size_t>(choice.nodes)) * 2 + choice.counting;
}
constexpr KernelChoice kernel_choice(std::size_t index) {
    const std::size_t query_and_accuracy = index / 2 / node_form_count;
    return {static_cast<QueryKind>(query_and_accuracy / accuracy_count),
            static_cast<Accuracy>(query_and_accuracy % accuracy_count),
            static_cast<NodeForm>(index / 2 % node_form_count), index % 2 != 0};
}

// Traces one thread's share of a batch, taking rays from the source until it is empty. in_flight rays are traced in
// turns; 1 is plain single-ray traversal, more need in_flight * flight_bytes of scratch, aligned to 64 bytes.
template <class Real>
using TraceBatch = void (*)(const BvhView&, const RayBatch<Real>&, const HitBatch<Real>&, const RaySource&,
                            unsigned in_flight, std::byte* scratch);

// The kernels for scenes of one precision.
template <class Real>
struct KernelTable {
    std::string_view name;
    std::size_t flight_bytes;                            // of the largest kernel
    std::array<TraceBatch<Real>, kernel_count> kernels;  // null: not in the table

    // Throws std::invalid_argument, naming the choice, if the table has no kernel for it.
    TraceBatch<Real> find(KernelChoice choice) const;
};

// One table of all the parts' kernels, each from the first part that has it; none if no part is compiled in (null).
template <class Real>
std::optional<KernelTable<Real>> join(std::string_view name, std::initializer_list<const KernelTable<Real>*> parts);

// Null if this build has no such kernels. dispatch.h tells whether this machine can run them.
const KernelTable<float>* avx512_full_kernels();
const KernelTable<float>* avx512_half_kernels();
const KernelTable<float>* avx2_kernels();
const KernelTable<float>* scalar_kernels();

const KernelTable<double>* avx512_float64_kernels();
const KernelTable<double>* avx2_float64_kernels();
const KernelTable<double>* scalar_float64_kernels();

}  // namespace wive
