// Instantiates a table of kernels; included once in each instruction set's own translation unit.
#pragma once

#include <algorithm>
#include <tuple>
#include <type_traits>
#include <utility>

#include "in_flight.h"
#include "kernels.h"
#include "query_exact.h"
#include "triangle_exact.h"
#include "triangle_fast.h"
#include "triangle_watertight.h"

namespace wive {

template <class Isa, template <class> class Slabs>
struct KernelMaker {
    template <QueryKind kind>
    using Query = std::tuple_element_t<static_cast<std::size_t>(kind), std::tuple<ClosestHit, AnyHit, AllHits, CountHits>>;

    template <template <class> class Triangles, class Query, bool counting>
    struct Kernel {
        static constexpr TraceBatch trace =
            trace_batch<Isa, Slabs, Triangles, Query, std::conditional_t<counting, StepCounters, NoCounters>>;
        static constexpr std::size_t flight_bytes = sizeof(Flight<typename Triangles<Isa>::Frame, Query, StepCounters>);
    };

    template <KernelChoice choice>
    static constexpr auto kernel() {
        using Asked = Query<choice.query>;
        if constexpr (choice.accuracy == Accuracy::fast)
            return Kernel<FastTriangles, Asked, choice.counting>{};
        else if constexpr (choice.accuracy == Accuracy::watertight)
            return Kernel<WatertightTriangles, Asked, choice.counting>{};
        else if constexpr (choice.query == QueryKind::closest)
            return Kernel<ExactTriangles, ExactClosestHit, choice.counting>{};
        else
            return Kernel<ExactTriangles, Asked, choice.counting>{};
    }

    template <std::size_t... index>
    static constexpr KernelTable table(std::string_view name, std::index_sequence<index...>) {
        return {name,
                std::max({decltype(kernel<kernel_choice(index)>())::flight_bytes...}),
                {decltype(kernel<kernel_choice(index)>())::trace...}};
    }
};

template <class Isa, template <class> class Slabs>
constexpr KernelTable make_kernel_table(std::string_view name) {
    return KernelMaker<Isa, Slabs>::table(name, std::make_index_sequence<kernel_count>());
}

}  // namespace wive
