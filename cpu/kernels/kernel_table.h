// Instantiates a table of kernels; included once in each instruction set's own translation unit.
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

namespace wive {

// The slab test of nodes that a table has no kernels for.
template <class>
struct NoSlabs;

// What a table, or the part of it that one translation unit makes, is made for.
using MadeFor = bool (*)(KernelChoice);
constexpr bool everything(KernelChoice) { return true; }
constexpr bool first_hits(KernelChoice choice) {
    return choice.query == QueryKind::closest || choice.query == QueryKind::any;
}
constexpr bool all_hits(KernelChoice choice) { return !first_hits(choice); }
// The half form: its steps are those of the full form, which counts them.
constexpr bool all_but_counting(KernelChoice choice) { return !choice.counting; }
// By distance: what `python -m bench order` and the tests compare.
constexpr bool closest_inexact(KernelChoice choice) {
    return choice.query == QueryKind::closest && choice.accuracy != Accuracy::exact;
}

template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed, MadeFor made_for>
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
        using Asked = Query<choice.query>;
        constexpr bool exact_of_doubles =
            choice.accuracy == Accuracy::exact && precision_of<Real> == Precision::float64;
        if constexpr (!made_for(choice) || exact_of_doubles || std::is_same_v<Slabs<Isa>, NoSlabs<Isa>>)
            return NoKernel{};
        else if constexpr (choice.accuracy == Accuracy::fast)
            return Kernel<Slabs, FastTriangles, Asked, choice.counting>{};
        else if constexpr (choice.accuracy == Accuracy::watertight)
            return Kernel<Slabs, WatertightTriangles, Asked, choice.counting>{};
        else if constexpr (choice.query == QueryKind::closest)
            return Kernel<Slabs, ExactTriangles, ExactClosestHit<typename Slabs<Isa>::Layout::Block>,
                          choice.counting>{};
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

template <class Isa, template <class> class ForFloat32, template <class> class ForCompressed, MadeFor made_for>
constexpr KernelTable<typename Isa::Real> make_kernel_table(std::string_view name) {
    return KernelMaker<Isa, ForFloat32, ForCompressed, made_for>::table(name, std::make_index_sequence<kernel_count>());
}

}  // namespace wive
