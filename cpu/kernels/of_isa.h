// The choice among what is compiled once per instruction set. For units of the core, which know by WIVE_X86_64 which
// instruction sets this build has.
#pragma once

#include <type_traits>

#include "kernels/parts.h"

namespace wive {

// The pointer that get(IsaConstant<isa>()) returns for an instruction set; null if this build lacks it.
template <IsaName isa>
using IsaConstant = std::integral_constant<IsaName, isa>;
template <class Get>
auto of_isa(IsaName isa, const Get& get) -> decltype(get(IsaConstant<IsaName::scalar>())) {
    if (isa == IsaName::scalar) return get(IsaConstant<IsaName::scalar>());
#if defined(WIVE_X86_64)
    return isa == IsaName::avx2 ? get(IsaConstant<IsaName::avx2>()) : get(IsaConstant<IsaName::avx512>());
#else
    return nullptr;
#endif
}

}  // namespace wive
