// Traversal steps per ray: what `stats=True` returns.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/layout.h"

namespace wive::WIVE_ISA {

struct NoCounters {
    [[gnu::always_inline]] void inner_node() {}
    [[gnu::always_inline]] void leaf() {}
    [[gnu::always_inline]] void block(const auto&) {}
    [[gnu::always_inline]] void write(const auto&, std::size_t) const {}
};

struct StepCounters {
    std::int32_t inner_nodes = 0, leaves = 0, triangles = 0;

    [[gnu::always_inline]] void inner_node() { ++inner_nodes; }
    [[gnu::always_inline]] void leaf() { ++leaves; }
    [[gnu::always_inline]] void block(const auto& block) {
        for (int lane = 0; lane < block_width; ++lane) triangles += block.prim_at(lane) >= 0;
    }
    [[gnu::always_inline]] void write(const auto& hits, std::size_t i) const {
        hits.stats[3 * i] = inner_nodes;
        hits.stats[3 * i + 1] = leaves;
        hits.stats[3 * i + 2] = triangles;
    }
};

}  // namespace wive::WIVE_ISA
