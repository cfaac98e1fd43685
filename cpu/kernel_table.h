// Instantiates a table of kernels; included once in each instruction set's own translation unit.
#pragma once

#include "in_flight.h"
#include "kernels.h"
#include "triangle_fast.h"
#include "triangle_watertight.h"

namespace wive {

template <class Isa, template <class> class Slabs>
constexpr KernelTable make_kernel_table(std::string_view name) {
    return {name,
            sizeof(Flight<Isa, ClosestHit, StepCounters>),  // the largest
            {{trace_batch<Isa, Slabs, FastTriangles, ClosestHit, NoCounters>,
              trace_batch<Isa, Slabs, FastTriangles, ClosestHit, StepCounters>},
             {trace_batch<Isa, Slabs, WatertightTriangles, ClosestHit, NoCounters>,
              trace_batch<Isa, Slabs, WatertightTriangles, ClosestHit, StepCounters>}},
            {{trace_batch<Isa, Slabs, FastTriangles, AnyHit, NoCounters>,
              trace_batch<Isa, Slabs, FastTriangles, AnyHit, StepCounters>},
             {trace_batch<Isa, Slabs, WatertightTriangles, AnyHit, NoCounters>,
              trace_batch<Isa, Slabs, WatertightTriangles, AnyHit, StepCounters>}}};
}

}  // namespace wive
