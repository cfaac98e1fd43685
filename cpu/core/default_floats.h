// The floating-point environment that the core computes in, whatever the calling thread has set.
#pragma once

#if defined(__SSE__)
#include <xmmintrin.h>
#elif defined(__aarch64__)
#include <cstdint>
#else
#include <cfenv>
#endif

namespace wive {

// While it lives, this thread rounds to nearest, keeps subnormal numbers and has no exceptions enabled. Hits must not
// depend on a library that switched flushing to zero on, and the bounds of accuracy.md hold for rounding to nearest.
class DefaultFloats {
public:
    DefaultFloats() : callers_(read()) {
        if ((callers_ & control) != (standard & control)) write(standard);
    }
    ~DefaultFloats() {
        if ((callers_ & control) != (standard & control)) write(callers_);
    }
    DefaultFloats(const DefaultFloats&) = delete;
    DefaultFloats& operator=(const DefaultFloats&) = delete;

private:
#if defined(__SSE__)
    // MXCSR; its lowest six bits are flags that operations raise.
    using Word = unsigned;
    static constexpr Word standard = 0x1f80, control = 0xffc0;
    static Word read() { return _mm_getcsr(); }
    static void write(Word word) { _mm_setcsr(word); }
#elif defined(__aarch64__)
    using Word = std::uint64_t;  // FPCR, which has no flags
    static constexpr Word standard = 0, control = ~Word{0};
    static Word read() {
        Word word;
        asm volatile("mrs %0, fpcr" : "=r"(word));
        return word;
    }
    static void write(Word word) { asm volatile("msr fpcr, %0" : : "r"(word) : "memory"); }
#else
    using Word = int;  // the rounding direction: standard C++ knows no more
    static constexpr Word standard = FE_TONEAREST, control = ~0;
    static Word read() { return std::fegetround(); }
    static void write(Word word) { std::fesetround(word); }
#endif

    const Word callers_;
};

}  // namespace wive
