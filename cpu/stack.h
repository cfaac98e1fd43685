// The traversal stack: children still to visit with the distance at which the ray enters them, nearest on top.
#pragma once

#include <cstdint>
#include <limits>

#include "layout.h"

namespace wive {

struct StackEntry {
    float tnear;
    std::uint32_t child;
};
static_assert(sizeof(StackEntry) == 8);

// Room for what a tree of max_depth can leave behind, and for the unused lanes of the topmost vector store.
//
// `top` points at the entry that was taken last; what a node pushes overwrites it. Below all others stands an
// entry that is always near enough to be taken, and whose child ends the traversal. It stands there twice, so that
// one may look at the entry below the top of an empty stack.
struct alignas(64) Stack {
    StackEntry entries[3 + max_stack + node_width];

    [[gnu::always_inline]] StackEntry* start() {
        entries[0] = entries[1] = {-std::numeric_limits<float>::infinity(), end_of_stack};
        return entries + 2;
    }
};

}  // namespace wive
