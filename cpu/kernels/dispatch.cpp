#include "kernels/dispatch.h"

#include <algorithm>
#include <stdexcept>

#include "core/processor.h"
#include "kernels/avx512_form.h"

namespace wive {
namespace {

struct Entry {
    std::string_view name;
    IsaName isa;
    const KernelTable<float>* (*kernels)();           // for "avx512" the first call chooses one of two forms
    const KernelTable<double>* (*float64_kernels)();  // null for a traversal of float32 scenes only
    bool compiled, runs;
    std::string_view needs;
};

const std::vector<Entry>& entries() {
    constexpr std::string_view avx512 = "AVX-512 F, VL, DQ or BW", avx2 = "AVX2, FMA, BMI1, BMI2, LZCNT or POPCNT";
    static const bool x86_64 = avx512_half_kernels() != nullptr;
    static const std::vector<Entry> all = {
        {"avx512", IsaName::avx512, avx512_kernels, avx512_float64_kernels, x86_64, has_avx512(), avx512},
        {"avx512.full", IsaName::avx512, avx512_full_kernels, avx512_float64_kernels, x86_64, has_avx512(), avx512},
        {"avx512.half", IsaName::avx512, avx512_half_kernels, nullptr, x86_64, has_avx512(), avx512},
        {"avx2", IsaName::avx2, avx2_kernels, avx2_float64_kernels, x86_64, has_avx2(), avx2},
        {"scalar", IsaName::scalar, scalar_kernels, scalar_float64_kernels, true, true, ""},
    };
    return all;
}

std::string why_not(const Entry& entry) {
    if (!entry.compiled) return "this build is for another processor architecture than x86-64";
    if (!entry.runs) return "this processor lacks " + std::string(entry.needs);
    return "";
}

// The entry of a name that this machine can run.
const Entry& find_entry(std::string_view name) {
    for (const Entry& entry : entries()) {
        if (entry.name != name) continue;
        if (const std::string reason = why_not(entry); !reason.empty())
            throw std::invalid_argument("kernel '" + std::string(name) + "' can't run here: " + reason);
        return entry;
    }
    throw std::invalid_argument("unknown kernel '" + std::string(name) + "'");
}

}  // namespace

std::vector<std::pair<std::string, std::string>> list_kernels() {
    std::vector<std::pair<std::string, std::string>> list;
    for (const Entry& entry : entries()) list.emplace_back(entry.name, why_not(entry));
    return list;
}

template <class Real>
const KernelTable<Real>& find_kernels(std::string_view name) {
    const Entry& entry = find_entry(name);
    if constexpr (precision_of<Real> == Precision::float32)
        return *entry.kernels();
    else if (entry.float64_kernels != nullptr)
        return *entry.float64_kernels();
    else
        throw std::invalid_argument(
            "kernel '" + std::string(name) +
            "' traces float32 scenes only: give vertices in float32, or use 'avx512', 'avx2' or 'scalar'");
}

template const KernelTable<float>& find_kernels(std::string_view);
template const KernelTable<double>& find_kernels(std::string_view);

IsaName find_isa(std::string_view name) { return find_entry(name).isa; }

IsaName best_isa() {
    // From the best to the one that runs everywhere.
    return std::ranges::find_if(entries(), [](const Entry& entry) { return entry.compiled && entry.runs; })->isa;
}

}  // namespace wive
