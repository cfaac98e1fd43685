// Instantiates a table of kernels; included once in each instruction set's own translation unit.
#pragma once

#include <algorithm>
#include <tuple>
#include <type_traits>
#include <utility>

#include "in_flight.h"
#include "kernels.h"
#include "triangle_fast.h"
#include "triangle_watertight.h"

namespace wive {

template <class Isa, template <class> class Slabs>
struct KernelMaker {
    template <QueryKind kind>
    using Query = std::tuple_element_t<static_cast<std::size_t>(kind), std::tuple<ClosestHit, AnyHit, AllHits, CountHits>>;

    template <KernelChoice choice, template <class> class Triangles>
    struct Made {
        using Counters = std::conditional_t<choice.counting, StepCounters, NoCounters>;
        static constexpr TraceBatch kernel = trace_batch<Isa, Slabs, Triangles, Query<choice.query>, Counters>;
        static constexpr std::size_t flight_bytes = sizeof(Flight<Isa, Triangles, Query<choice.query>, Counters>);
    };
    template <KernelChoice choice>
    using Maker = std::conditional_t<choice.accuracy == Accuracy::fast, Made<choice, FastTriangles>,
                                     Made<choice, WatertightTriangles>>;

    template <std::size_t... index>
    static constexpr KernelTable table(std::string_view name, std::index_sequence<index...>) {
        return {name,
                std::max({Maker<kernel_choice(index)>::flight_bytes...}),
                {Maker<kernel_choice(index)>::kernel...}};
    }
};

template <class Isa, template <class> class Slabs>
constexpr KernelTable make_kernel_table(std::string_view name) {
    return KernelMaker<Isa, Slabs>::table(name, std::make_index_sequence<kernel_count>());
}

}  // namespace wive
