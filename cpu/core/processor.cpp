#include "core/processor.h"

#if defined(__x86_64__)
#include <cpuid.h>

#include <cstdint>
#endif

namespace wive {
namespace {

#if defined(__x86_64__)
// Not by __builtin_cpu_supports: its answer comes from the compiler's run-time library, and some have none for it or
// always say no.
struct Registers {
    unsigned a = 0, b = 0, c = 0, d = 0;
};
Registers cpuid(unsigned leaf) {
    Registers r;
    __get_cpuid_count(leaf, 0, &r.a, &r.b, &r.c, &r.d);  // all 0 for a leaf that the processor doesn't have
    return r;
}

template <class... Bits>
constexpr bool has_all(std::uint32_t word, Bits... bits) {
    return ((word >> bits & 1u) && ...);
}

// Which registers the system keeps for a process: XCR0.
std::uint32_t kept_registers() {
    std::uint32_t low = 0, high = 0;
    asm volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return low;
}

struct Processor {
    bool avx2 = false, avx512 = false, clmul = false, wide_clmul = false;

    Processor() {
        // Intel's Software Developer's Manual, volume 2, CPUID, and AMD's volume 3, appendix E.
        constexpr int clmul_bit = 1, fma = 12, popcnt = 23, osxsave = 27, lzcnt = 5;        // words c
        constexpr int bmi1 = 3, avx2_bit = 5, bmi2 = 8, f = 16, dq = 17, bw = 30, vl = 31;  // word b of leaf 7
        constexpr int vpclmul = 10;                                                         // word c of leaf 7
        constexpr int xmm = 1, ymm = 2;                                                     // XCR0
        const std::uint32_t basic = cpuid(1).c, extended = cpuid(0x80000001u).c;
        const auto [a, more, even_more, d] = cpuid(7);
        clmul = has_all(basic, clmul_bit);
        if (!has_all(basic, osxsave)) return;
        const std::uint32_t kept = kept_registers();
        avx2 = has_all(basic, fma, popcnt) && has_all(more, avx2_bit, bmi1, bmi2) && has_all(extended, lzcnt) &&
               has_all(kept, xmm, ymm);
#if defined(__APPLE__)
        const bool keeps_zmm = true;  // macOS sets these bits at a thread's first use of such a register
#else
        constexpr int masks = 5, zmm_low = 6, zmm_high = 7;  // XCR0
        const bool keeps_zmm = has_all(kept, masks, zmm_low, zmm_high);
#endif
        avx512 = avx2 && has_all(more, f, dq, bw, vl) && keeps_zmm;
        wide_clmul = avx512 && has_all(even_more, vpclmul);
    }
};
#else
struct Processor {
    bool avx2 = false, avx512 = false, clmul = false, wide_clmul = false;
};
#endif

// Asked once: on a virtual machine one CPUID instruction takes microseconds.
const Processor& processor() {
    static const Processor here;
    return here;
}

}  // namespace

bool has_avx2() { return processor().avx2; }
bool has_avx512() { return processor().avx512; }
bool has_clmul() { return processor().clmul; }
bool has_wide_clmul() { return processor().wide_clmul; }

}  // namespace wive
