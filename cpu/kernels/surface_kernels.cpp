#include "kernels/surface_kernels.h"

namespace wive {

template <class Real>
const SurfaceKernels<Real>* find_surface_kernels(IsaName isa) {
    if (isa == IsaName::scalar) return surface_kernels<IsaName::scalar, Real>();
#if defined(WIVE_X86_64)
    return isa == IsaName::avx2 ? surface_kernels<IsaName::avx2, Real>() : surface_kernels<IsaName::avx512, Real>();
#else
    return nullptr;
#endif
}

template const SurfaceKernels<float>* find_surface_kernels(IsaName);
template const SurfaceKernels<double>* find_surface_kernels(IsaName);

}  // namespace wive
