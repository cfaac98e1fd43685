// The traversal stack: children still to visit, each with the distance at which the ray enters its box, nearest on top.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/layout.h"

namespace wive::WIVE_ISA {

// Two parallel arrays: the child that is entered at distances[i] is children[i]. There is room for what a tree of
// max_depth can leave behind, and for the unused lanes of the topmost vector store.
//
// The lowest entries are sentinels (distance -infinity, child end_of_stack): popping the first one ends the traversal,
// and the other two make it safe to read and prefetch the entries at top - 1 and top - 2.
struct alignas(64) Stack {
    static constexpr std::ptrdiff_t sentinels = 3;
    static constexpr std::ptrdiff_t size = (1 + sentinels + max_stack + node_width + 15) / 16 * 16;
    float distances[size];
    std::uint32_t children[size];

    // The entry that was popped last, as a pointer to its distance; what a node pushes overwrites it. Its child is
    // `size` floats behind its distance, so that one register holds both places.
    class Top {
    public:
        Top() = default;
        [[gnu::always_inline]] explicit Top(Stack& stack) : distance_(stack.distances + sentinels) {
            for (int i = 0; i < sentinels; ++i) {
                stack.distances[i] = -std::numeric_limits<float>::infinity();
                stack.children[i] = end_of_stack;
            }
#ifndef NDEBUG
            bottom_ = stack.distances;
#endif
        }
        // Moves to the entry that ends the traversal if `ends`, without a branch.
        [[gnu::always_inline]] void move_to_end_if(bool ends, Stack& stack) {
            float* const end = stack.distances + sentinels - 1;
            distance_ += (end - distance_) & -static_cast<std::ptrdiff_t>(ends);
        }
        [[gnu::always_inline]] float& distance(std::ptrdiff_t i = 0) const { return distance_[i]; }
        [[gnu::always_inline]] std::uint32_t& child(std::ptrdiff_t i = 0) const {
            return *reinterpret_cast<std::uint32_t*>(reinterpret_cast<std::byte*>(distance_ + i) +
                                                     sizeof(float) * size);
        }
        [[gnu::always_inline]] void move(std::ptrdiff_t entries) {
            distance_ += entries;
            // Not below the first sentinel, and never so high that the next vector store would leave the stack.
            assert(distance_ - bottom_ >= sentinels - 1 && distance_ - bottom_ <= size - node_width);
        }

    private:
        float* distance_ = nullptr;
#ifndef NDEBUG
        const float* bottom_ = nullptr;  // of the stack
#endif
    };
};

}  // namespace wive::WIVE_ISA
