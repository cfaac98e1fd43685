// An instruction set for scenes of doubles: rays and triangles in double, boxes in float.
#pragma once

#include "traverse/concepts.h"

namespace wive::WIVE_ISA {

template <Isa Base>
struct Float64 : Base {
    using Real = double;
    using Real4 = typename Base::Double4;
};

}  // namespace wive::WIVE_ISA
