// When to try next what pays for some rays of a batch and costs the others a little.
#pragma once

#include <cstddef>

namespace wive::WIVE_ISA {

// After a try in vain the next rays go without one; after several in a row, more and more of them: with a pause of p
// rays, the next is one of 2 p + 16.
class Pauses {
public:
    // shortest: the first pause after a try that was worthwhile; first: that before any was.
    constexpr Pauses(std::size_t shortest, std::size_t first) : shortest_(shortest), pause_(first) {}

    // Whether a try may begin at ray i.
    [[gnu::always_inline]] bool allow(std::size_t i) const { return i >= next_try_; }

    [[gnu::always_inline]] void worthwhile() { pause_ = shortest_; }
    // next: the first ray after the try.
    [[gnu::always_inline]] void in_vain(std::size_t next) {
        next_try_ = next + pause_;
        pause_ = pause_ < longest ? 2 * pause_ + step : longest;
    }
    // No try from now on.
    [[gnu::always_inline]] void never() { next_try_ = ~std::size_t{0}; }

private:
    static constexpr std::size_t step = 16, longest = 2032;

    std::size_t shortest_, pause_, next_try_ = 0;  // in rays
};

}  // namespace wive::WIVE_ISA
