#include "kernels/surface_kernels.h"

#include "kernels/of_isa.h"

namespace wive {

template <class Real>
const SurfaceKernels<Real>* find_surface_kernels(IsaName isa) {
    return of_isa(isa, [](auto known) { return surface_kernels<known(), Real>(); });
}

template const SurfaceKernels<float>* find_surface_kernels(IsaName);
template const SurfaceKernels<double>* find_surface_kernels(IsaName);

}  // namespace wive
