// Instantiates a table of kernels. Included in units of one instruction set each, which CMakeLists.txt names in
// WIVE_ISA: the namespace of all that such a unit instantiates, so that the linker never takes one instruction set's
// code for another's.
#pragma once

#include <algorithm>
#include <tuple>
#include <type_traits>
#include <utility>

#include "kernels/kernels.h"
#include "traverse/in_flight.h"
#include "traverse/query_exact.h"
#include "traverse/triangle_exact.h"
#include "traverse/triangle_fast.h"
#include "traverse/triangle_watertight.h"

namespace wive::WIVE_ISA {

// In place of a slab test: the table has no kernels for that node form.
template <class>
struct NoSlabs;

// Which kernels a table, or the part of it that one translation unit makes, holds.
using KernelFilter = bool (*)(KernelChoice);
constexpr bool every_kernel(KernelChoice) { return true; }
constexpr bool is_first_hit(KernelChoice choice) {
    return choice.query == QueryKind::closest || choice.query == QueryKind::any;
}
constexpr bool is_multi_hit(KernelChoice choice) { return !is_first_hit(choice); }
// The half form takes the steps of the full form, which counts them.
constexpr bool is_without_counters(KernelChoice choice) { return !choice.counting; }

template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed, KernelFilter filter>
struct KernelMaker {
    using Real = typename Isa::Real;

    template <QueryKind kind>
    using Query = std::tuple_element_t<static_cast<std::size_t>(kind),
                                       std::tuple<ClosestHit<Real>, AnyHit<Real>, AllHits<Real>, CountHits<Real>>>;

    template <template <class> class Slabs, template <class> class Triangles, class Query, bool counting>
    struct Kernel {
        static constexpr TraceBatch<Real> trace =
            trace_batch<Isa, Slabs, Triangles, Query, std::conditional_t<counting, StepCounters, NoCounters>>;
        static constexpr std::size_t flight_bytes =
            sizeof(Flight<typename Triangles<Isa>::Frame, typename Query::InFlight, StepCounters>);
    };
    struct NoKernel {
        static constexpr TraceBatch<Real> trace = nullptr;
        static constexpr std::size_t flight_bytes = 0;
    };

    template <KernelChoice choice, template <class> class Slabs>
    static constexpr auto kernel_with() {
        using QueryType = Query<choice.query>;
        constexpr bool exact_of_doubles =
            choice.accuracy == Accuracy::exact && precision_of<Real> == Precision::float64;
        if constexpr (!filter(choice) || exact_of_doubles || std::is_same_v<Slabs<Isa>, NoSlabs<Isa>>)
            return NoKernel{};
        else if constexpr (choice.accuracy == Accuracy::fast)
            return Kernel<Slabs, FastTriangles, QueryType, choice.counting>{};
        else if constexpr (choice.accuracy == Accuracy::watertight)
            return Kernel<Slabs, WatertightTriangles, QueryType, choice.counting>{};
        else if constexpr (choice.query == QueryKind::closest)
            return Kernel<Slabs, ExactTriangles, ExactClosestHit<typename Slabs<Isa>::Layout::Block>,
                          choice.counting>{};
        else
            return Kernel<Slabs, ExactTriangles, QueryType, choice.counting>{};
    }

    template <KernelChoice choice>
    static constexpr auto kernel() {
        if constexpr (choice.nodes == NodeForm::float32)
            return kernel_with<choice, ForFloat32>();
        else
            return kernel_with<choice, ForCompressed>();
    }

    template <std::size_t... index>
    static constexpr KernelTable<Real> table(std::index_sequence<index...>) {
        return {"",
                std::max({decltype(kernel<kernel_choice(index)>())::flight_bytes...}),
                {decltype(kernel<kernel_choice(index)>())::trace...}};
    }
};

// A table without a name: `join` names it.
template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed, KernelFilter filter>
constexpr KernelTable<typename Isa::Real> make_kernel_table() {
    return KernelMaker<Isa, ForFloat32, ForCompressed, filter>::table(std::make_index_sequence<kernel_count>());
}

}  // namespace wive::WIVE_ISA
