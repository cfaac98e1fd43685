// An instruction set whose scenes hold doubles: boxes are met as ever, rays and triangles in double.
#pragma once

namespace wive {

template <class Isa>
struct Float64 : Isa {
    using Real = double;
    using Real4 = typename Isa::Double4;
};

}  // namespace wive
