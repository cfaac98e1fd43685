#include "kernels/kernels.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace wive {
namespace {

std::string describe(KernelChoice choice) {
    constexpr std::string_view queries[query_count] = {"closest", "any", "all", "count"};
    constexpr std::string_view accuracies[accuracy_count] = {"fast", "watertight", "exact"};
    constexpr std::string_view forms[node_form_count] = {"float32", "compressed"};
    return "query '" + std::string(queries[static_cast<std::size_t>(choice.query)]) + "', accuracy '" +
           std::string(accuracies[static_cast<std::size_t>(choice.accuracy)]) + "', nodes '" +
           std::string(forms[static_cast<std::size_t>(choice.nodes)]) + "'" + (choice.counting ? " with stats" : "");
}

}  // namespace

template <class Real>
TraceBatch<Real> KernelTable<Real>::find(KernelChoice choice) const {
    const TraceBatch<Real> kernel = kernels[kernel_index(choice)];
    if (kernel == nullptr)
        throw std::invalid_argument("kernel '" + std::string(name) + "' was not made for " + describe(choice) +
                                    ": 'avx512', 'avx2' and 'scalar' are made for everything");
    return kernel;
}

template struct KernelTable<float>;
template struct KernelTable<double>;

std::optional<KernelTable<float>> join(std::string_view name, std::initializer_list<const KernelTable<float>*> parts) {
    KernelTable<float> table = {name, 0, {}};
    for (const KernelTable<float>* part : parts) {
        if (part == nullptr) continue;
        table.flight_bytes = std::max(table.flight_bytes, part->flight_bytes);
        std::transform(table.kernels.begin(), table.kernels.end(), part->kernels.begin(), table.kernels.begin(),
                       [](TraceBatch<float> had, TraceBatch<float> more) { return had != nullptr ? had : more; });
    }
    if (table.flight_bytes == 0) return std::nullopt;
    return table;
}

const KernelTable<float>* avx512_full_kernels() {
    static const auto table = join("avx512.full", {avx512_full_first_hits(), avx512_full_all_hits()});
    return table ? &*table : nullptr;
}

const KernelTable<float>* avx2_kernels() {
    static const auto table = join("avx2", {avx2_first_hits(), avx2_all_hits()});
    return table ? &*table : nullptr;
}

const KernelTable<float>* scalar_kernels() {
    static const auto table = join("scalar", {scalar_first_hits(), scalar_all_hits()});
    return table ? &*table : nullptr;
}

}  // namespace wive
