// The traversal stack: children still to visit with the distance at which the ray enters them, nearest on top.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/layout.h"

namespace wive {

// Room for what a tree of max_depth can leave behind, and for the unused lanes of the topmost vector stores.
//
// `top` points at the distance of the entry that was taken last; what a node pushes overwrites it. An entry's child
// stands a fixed way behind its distance. Below all others is an entry that is always near enough to be taken, and
// whose child ends the traversal. It stands there several times, so that one may look at entries below the top of an
// empty stack.
struct alignas(64) Stack {
    static constexpr std::ptrdiff_t lowest = 3;  // entries that end the traversal
    static constexpr std::ptrdiff_t size = (1 + lowest + max_stack + node_width + 15) / 16 * 16;
    float distances[size];
    std::uint32_t children[size];

    class Top {
    public:
        Top() = default;
        [[gnu::always_inline]] explicit Top(Stack& stack) : distance_(stack.distances + lowest) {
            for (int i = 0; i < lowest; ++i) {
                stack.distances[i] = -std::numeric_limits<float>::infinity();
                stack.children[i] = end_of_stack;
            }
        }
        [[gnu::always_inline]] float& distance(std::ptrdiff_t i = 0) const { return distance_[i]; }
        [[gnu::always_inline]] std::uint32_t& child(std::ptrdiff_t i = 0) const {
            return *reinterpret_cast<std::uint32_t*>(reinterpret_cast<std::byte*>(distance_ + i) +
                                                     sizeof(float) * size);
        }
        [[gnu::always_inline]] void move(std::ptrdiff_t entries) { distance_ += entries; }

    private:
        float* distance_ = nullptr;
    };
};

}  // namespace wive
