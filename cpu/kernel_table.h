// Instantiates a table of kernels; included once in each instruction set's own translation unit.
#pragma once

#include <algorithm>
#include <type_traits>
#include <utility>

#include "in_flight.h"
#include "kernels.h"
#include "triangle_fast.h"
#include "triangle_watertight.h"

namespace wive {

// The slab test of nodes that a table has no kernels for.
template <class>
struct NoSlabs;

template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed>
struct KernelMaker {
    template <QueryKind kind>
    using Query = std::conditional_t<kind == QueryKind::closest, ClosestHit, AnyHit>;

    template <KernelChoice choice, template <class> class Slabs>
    static constexpr TraceBatch kernel_with() {
        using Counters = std::conditional_t<choice.counting, StepCounters, NoCounters>;
        if constexpr (std::is_same_v<Slabs<Isa>, NoSlabs<Isa>>)
            return nullptr;
        else if constexpr (choice.accuracy == Accuracy::fast)
            return trace_batch<Isa, Slabs, FastTriangles, Query<choice.query>, Counters>;
        else
            return trace_batch<Isa, Slabs, WatertightTriangles, Query<choice.query>, Counters>;
    }

    template <KernelChoice choice>
    static constexpr TraceBatch kernel() {
        if constexpr (choice.nodes == NodeForm::float32)
            return kernel_with<choice, ForFloat32>();
        else
            return kernel_with<choice, ForCompressed>();
    }

    template <std::size_t... index>
    static constexpr KernelTable table(std::string_view name, std::index_sequence<index...>) {
        return {name,
                std::max({sizeof(Flight<Isa, Query<kernel_choice(index).query>, StepCounters>)...}),
                {kernel<kernel_choice(index)>()...}};
    }
};

template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed = NoSlabs>
constexpr KernelTable make_kernel_table(std::string_view name) {
    return KernelMaker<Isa, ForFloat32, ForCompressed>::table(name, std::make_index_sequence<kernel_count>());
}

}  // namespace wive
