#include "kernels/kernels.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "kernels/parts.h"

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

template <class Real>
std::optional<KernelTable<Real>> join(std::string_view name, std::initializer_list<const KernelTable<Real>*> parts) {
    KernelTable<Real> table = {name, 0, {}};
    for (const KernelTable<Real>* part : parts) {
        if (part == nullptr) continue;
        table.flight_bytes = std::max(table.flight_bytes, part->flight_bytes);
        std::transform(table.kernels.begin(), table.kernels.end(), part->kernels.begin(), table.kernels.begin(),
                       [](TraceBatch<Real> had, TraceBatch<Real> more) { return had != nullptr ? had : more; });
    }
    if (table.flight_bytes == 0) return std::nullopt;
    return table;
}

template std::optional<KernelTable<float>> join(std::string_view, std::initializer_list<const KernelTable<float>*>);
template std::optional<KernelTable<double>> join(std::string_view, std::initializer_list<const KernelTable<double>*>);

namespace {

#if defined(WIVE_X86_64)
constexpr bool is_x86_64 = true;
#else
constexpr bool is_x86_64 = false;
#endif

// The parts of one instruction set under one name; null if this build is for another architecture.
template <class Real, IsaName isa, Part... parts>
const KernelTable<Real>* joined(std::string_view name) {
    if constexpr (isa == IsaName::scalar || is_x86_64) {
        static const auto table = join<Real>(name, {part_table<isa, parts>()...});
        return table ? &*table : nullptr;
    } else {
        return nullptr;
    }
}

}  // namespace

const KernelTable<float>* avx512_full_kernels() {
    return joined<float, IsaName::avx512, Part::first_hit, Part::multi_hit>("avx512.full");
}
const KernelTable<float>* avx512_half_kernels() { return joined<float, IsaName::avx512, Part::half>("avx512.half"); }
const KernelTable<float>* avx2_kernels() {
    return joined<float, IsaName::avx2, Part::first_hit, Part::multi_hit>("avx2");
}
const KernelTable<float>* scalar_kernels() {
    return joined<float, IsaName::scalar, Part::first_hit, Part::multi_hit>("scalar");
}

const KernelTable<double>* avx512_float64_kernels() { return joined<double, IsaName::avx512, Part::float64>("avx512"); }
const KernelTable<double>* avx2_float64_kernels() { return joined<double, IsaName::avx2, Part::float64>("avx2"); }
const KernelTable<double>* scalar_float64_kernels() { return joined<double, IsaName::scalar, Part::float64>("scalar"); }

}  // namespace wive
