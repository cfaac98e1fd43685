// The compiled kernels, one table an instruction set and form.
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

// What a kernel is made for; each holds the code of exactly that.
struct KernelChoice {
    QueryKind query;
    Accuracy accuracy;
    NodeForm nodes;
    bool counting;  // of steps, per ray
};
inline constexpr std::size_t kernel_count = query_count * accuracy_count * node_form_count * 2;

constexpr std::size_t kernel_index(KernelChoice choice) {
    const std::size_t made_for =
        static_cast<std::size_t>(choice.query) * accuracy_count + static_cast<std::size_t>(choice.accuracy);
    return (made_for * node_form_count + static_cast<std::size_t>(choice.nodes)) * 2 + choice.counting;
}
constexpr KernelChoice kernel_choice(std::size_t index) {
    const std::size_t made_for = index / 2 / node_form_count;
    return {static_cast<QueryKind>(made_for / accuracy_count), static_cast<Accuracy>(made_for % accuracy_count),
            static_cast<NodeForm>(index / 2 % node_form_count), index % 2 != 0};
}

// One thread's share of a batch: rays come from the source until it is empty. in_flight rays are traced in turns;
// 1 is plain single-ray traversal. scratch: in_flight * flight_bytes of 64-byte aligned memory where it is above 1.
template <class Real>
using TraceBatch = void (*)(const BvhView&, const RayBatch<Real>&, const HitBatch<Real>&, const RaySource&,
                            unsigned in_flight, std::byte* scratch);

// The kernels for scenes of one precision.
template <class Real>
struct KernelTable {
    std::string_view name;
    std::size_t flight_bytes;                            // of the largest kernel
    std::array<TraceBatch<Real>, kernel_count> kernels;  // null: the table was not made for this

    // Throws std::invalid_argument, naming the choice, where the table was not made for it.
    TraceBatch<Real> find(KernelChoice choice) const;
};

// One table of all the parts' kernels, each from the first part that has it; none where no part is compiled in (null).
std::optional<KernelTable<float>> join(std::string_view name, std::initializer_list<const KernelTable<float>*> parts);

// Null where this build has no such kernels; whether the machine can run them is dispatch.h's business.
const KernelTable<float>* avx512_full_kernels();
const KernelTable<float>* avx512_half_kernels();
const KernelTable<float>* avx512_by_distance_kernels();
const KernelTable<float>* avx2_kernels();
const KernelTable<float>* scalar_kernels();
const KernelTable<float>* scalar_by_distance_kernels();

const KernelTable<double>* avx512_float64_kernels();
const KernelTable<double>* avx2_float64_kernels();
const KernelTable<double>* scalar_float64_kernels();

// Parts of these, each from a translation unit of its own: closest and any hit; all hits and their number.
const KernelTable<float>* avx512_full_first_hits();
const KernelTable<float>* avx512_full_all_hits();
const KernelTable<float>* avx2_first_hits();
const KernelTable<float>* avx2_all_hits();
const KernelTable<float>* scalar_first_hits();
const KernelTable<float>* scalar_all_hits();

}  // namespace wive
