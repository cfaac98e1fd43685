// The portable kernels with the children sorted by true entry distance: what sorting would save.
#pragma once

#include <utility>

#include "traverse/simd_scalar.h"

namespace wive::WIVE_ISA {

struct ByDistance : Scalar {
    template <bool in_order>
    struct Lanes : Scalar::Lanes<in_order> {
        WIVE_INLINE Lanes(const Order& order, Hits hit, const Float8& distances, const std::uint32_t* children)
            : Scalar::Lanes<in_order>(order, hit, distances, children) {
            for (int i = 1; i < node_width; ++i)
                for (int k = i; k > 0 && this->tnear[this->slots[k - 1]] < this->tnear[this->slots[k]]; --k)
                    std::swap(this->slots[k - 1], this->slots[k]);
        }
    };
};

}  // namespace wive::WIVE_ISA
