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

// The slab test of nodes that a table has no kernels for.
template <class>
struct NoSlabs;

template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed>
struct KernelMaker {
    using Real = typename Isa::Real;

    template <QueryKind kind>
    using Query = std::tuple_element_t<static_cast<std::size_t>(kind), std::tuple<ClosestHit<Real>, AnyHit<Real>, AllHits<Real>, CountHits<Real>>>;

    template <template <class> class Slabs, template <class> class Triangles, class Query, bool counting>
    struct Kernel {
        static constexpr TraceBatch<Real> trace =
            trace_batch<Isa, Slabs, Triangles, Query, std::conditional_t<counting, StepCounters, NoCounters>>;
        static constexpr std::size_t flight_bytes = sizeof(Flight<typename Triangles<Isa>::Frame, Query, StepCounters>);
    };
    struct NoKernel {
        static constexpr TraceBatch<Real> trace = nullptr;
        static constexpr std::size_t flight_bytes = 0;
    };

    template <KernelChoice choice, template <class> class Slabs>
    static constexpr auto kernel_with() {
        using Asked = Query<choice.query>;
        constexpr bool exact_of_doubles = choice.accuracy == Accuracy::exact && precision_of<Real> == Precision::float64;
        if constexpr (std::is_same_v<Slabs<Isa>, NoSlabs<Isa>> || exact_of_doubles)
            return NoKernel{};
        else if constexpr (choice.accuracy == Accuracy::fast)
            return Kernel<Slabs, FastTriangles, Asked, choice.counting>{};
        else if constexpr (choice.accuracy == Accuracy::watertight)
            return Kernel<Slabs, WatertightTriangles, Asked, choice.counting>{};
        else if constexpr (choice.query == QueryKind::closest)
            return Kernel<Slabs, ExactTriangles, ExactClosestHit<typename Slabs<Isa>::Form::Block>, choice.counting>{};
        else
            return Kernel<Slabs, ExactTriangles, Asked, choice.counting>{};
    }

    template <KernelChoice choice>
    static constexpr auto kernel() {
        if constexpr (choice.nodes == NodeForm::float32)
            return kernel_with<choice, ForFloat32>();
        else
            return kernel_with<choice, ForCompressed>();
    }

    template <std::size_t... index>
    static constexpr KernelTable<Real> table(std::string_view name, std::index_sequence<index...>) {
        return {name,
                std::max({decltype(kernel<kernel_choice(index)>())::flight_bytes...}),
                {decltype(kernel<kernel_choice(index)>())::trace...}};
    }
};

template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed = NoSlabs>
constexpr KernelTable<typename Isa::Real> make_kernel_table(std::string_view name) {
    return KernelMaker<Isa, ForFloat32, ForCompressed>::table(name, std::make_index_sequence<kernel_count>());
}

}  // namespace wive
