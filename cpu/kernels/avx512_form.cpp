#include "kernels/avx512_form.h"

#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>

#include "kernels/kernel_race.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace wive {
namespace {

constexpr std::string_view full = "full", half = "half", race = "race";

#if defined(__x86_64__)
// Processor families on which both forms have been measured at length.
struct Measured {
    std::string_view vendor;
    unsigned family;
    std::string_view better;
};
constexpr Measured measured[] = {
    {"AuthenticAMD", 0x19, full},  // Zen 4, the only one of this family with AVX-512: its units are 256 bits wide
};

// The form known to be faster on this machine, or `race`.
std::string_view known_form() {
    unsigned highest = 0, signature = 0, name[3] = {}, unused = 0;
    if (__get_cpuid(0, &highest, &name[0], &name[2], &name[1]) != 0 &&
        __get_cpuid(1, &signature, &unused, &unused, &unused) != 0) {
        char vendor[sizeof name];
        std::memcpy(vendor, name, sizeof name);
        const unsigned base = signature >> 8 & 0xf, family = base == 0xf ? base + (signature >> 20 & 0xff) : base;
        for (const Measured& machine : measured)
            if (machine.vendor == std::string_view(vendor, sizeof vendor) && machine.family == family)
                return machine.better;
    }
    return race;
}
#else
std::string_view known_form() { return race; }
#endif

std::string_view choose() {
    std::string_view form = known_form();
    if (const char* asked = std::getenv("WIVE_AVX512_FORM"); asked != nullptr && *asked != '\0') {
        if (asked != full && asked != half && asked != race)
            throw std::invalid_argument("WIVE_AVX512_FORM must be 'full', 'half' or 'race', got '" +
                                        std::string(asked) + "': unset it to leave the choice to wive");
        form = asked == full ? full : asked == half ? half : race;
    }
    if (form != race) return form;
    return is_faster(*avx512_half_kernels(), *avx512_full_kernels()) ? half : full;
}

}  // namespace

std::string_view avx512_form() {
    static const std::string_view form = choose();
    return form;
}

const KernelTable<float>* avx512_kernels() {
    static const auto table =
        join<float>("avx512", {avx512_form() == half ? avx512_half_kernels() : nullptr, avx512_full_kernels()});
    return table ? &*table : nullptr;
}

}  // namespace wive
