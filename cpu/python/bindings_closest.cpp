// Closest points of the surface, as Python calls them.
#include "core/memory.h"
#include "kernels/closest_kernels.h"
#include "python/bindings.h"

namespace wive {
namespace {

IsaName isa_of(const KernelArg& kernel) {
    if (const auto* handle = std::get_if<const PyKernels*>(&kernel)) {
        expect(*handle != nullptr, "kernel: expected Kernels or a name, got None");
        return find_isa((*handle)->name());
    }
    return find_isa(std::get<std::string>(kernel));
}

template <class Real>
py::tuple closest(const PyBvh& self, const KernelArg& kernel, const Array<Real>& points,
                  const Array<Real>& max_distance, unsigned threads) {
    self.expect_precision<Real>();
    expect_shape(points, 3, "points: expected shape (n, 3)");
    const py::ssize_t count = points.shape(0);
    expect(max_distance.size() == 1 || max_distance.size() == count,
           "max_distance: expected one value or one per point");
    const Bvh& bvh = self.bvh();
    const FindClosest<Real> find = find_closest_kernels<Real>(isa_of(kernel))->find(bvh.accuracy(), bvh.node_form());
    const auto size = static_cast<std::size_t>(count);
    expect_memory(size * (3 * sizeof(Real) + sizeof(std::int32_t)));
    auto distance = new_array<Real>({count}), uv = new_array<Real>({count, 2});
    auto prim = new_array<std::int32_t>({count});
    const PointBatch<Real> batch = {points.data(), max_distance.data(), max_distance.size() == 1 ? 0u : 1u};
    const ClosestBatch<Real> out = {distance.mutable_data(), prim.mutable_data(), uv.mutable_data()};
    {
        const Released released;
        find_closest_points(find, bvh.view(), batch, out, size, threads);
    }
    return py::make_tuple(std::move(distance), std::move(prim), std::move(uv));
}

template <class Real>
Array<double> winding(const PyBvh& self, const Array<Real>& points, unsigned threads) {
    self.expect_precision<Real>();
    expect_shape(points, 3, "points: expected shape (n, 3)");
    const auto size = static_cast<std::size_t>(points.shape(0));
    expect_memory(size * sizeof(double));
    auto answer = new_array<double>({points.shape(0)});
    const Real* from = points.data();
    double* out = answer.mutable_data();
    {
        const Released released;
        self.winding<Real>().find(from, size, out, threads);
    }
    return answer;
}

}  // namespace

void bind_closest(PyBvhClass& bvh) {
    for_each_precision([&]<class Real>(Real) {
        bvh.def("closest", &closest<Real>, py::arg("kernel"), array_arg("points"), array_arg("max_distance"),
                py::arg("threads") = 0);
        bvh.def("winding", &winding<Real>, array_arg("points"), py::arg("threads") = 0);
    });
}

}  // namespace wive
