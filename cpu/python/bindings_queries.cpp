// The queries of a tree, as Python calls them.
#include <optional>

#include "kernels/dispatch.h"
#include "kernels/gather.h"
#include "kernels/trace.h"
#include "python/bindings.h"

namespace wive {
namespace {

template <class Real>
struct Rays {
    RayBatch<Real> batch;
    std::size_t count;
};

template <class Real>
Rays<Real> ray_batch(const PyBvh& self, const Array<Real>& origins, const Array<Real>& directions,
                     const Array<Real>& tmin, const Array<Real>& tmax) {
    self.expect_precision<Real>();
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    expect_shape(directions, 3, "directions: expected shape (n, 3)");
    const py::ssize_t n = origins.shape(0);
    expect(directions.shape(0) == n, "directions: expected as many as origins");
    expect(tmin.size() == 1 || tmin.size() == n, "tmin: expected one value or one a ray");
    expect(tmax.size() == 1 || tmax.size() == n, "tmax: expected one value or one a ray");
    const auto stride = [](const Array<Real>& a) { return static_cast<std::size_t>(a.size() == 1 ? 0 : 1); };
    return {{origins.data(), directions.data(), tmin.data(), tmax.data(), stride(tmin), stride(tmax)},
            static_cast<std::size_t>(n)};
}

// Traces the rays with the interpreter lock released.
template <class Real>
void trace_released(const PyBvh& self, const std::string& kernel, QueryKind query, const Rays<Real>& rays,
                    const HitBatch<Real>& hits, unsigned threads, unsigned in_flight) {
    const KernelTable<Real>& table = find_kernels<Real>(kernel);
    const TraceBatch<Real> batch =
        table.find({query, self.bvh().accuracy(), self.bvh().node_form(), hits.stats != nullptr});
    const BvhView bvh = self.bvh().view();
    py::gil_scoped_release release;
    trace(table, batch, bvh, rays.batch, hits, rays.count, threads, in_flight);
}

template <class Real>
py::tuple intersect(const PyBvh& self, const std::string& kernel, const Array<Real>& origins,
                    const Array<Real>& directions, const Array<Real>& tmin, const Array<Real>& tmax, unsigned threads,
                    unsigned in_flight, bool stats) {
    const Rays<Real> rays = ray_batch(self, origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<Real> t(n), uv({n, py::ssize_t{2}});
    Array<std::int32_t> prim(n);
    std::optional<Array<std::int32_t>> steps;
    HitBatch<Real> hits;
    hits.t = t.mutable_data();
    hits.prim = prim.mutable_data();
    hits.uv = uv.mutable_data();
    if (stats) hits.stats = steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data();
    trace_released(self, kernel, QueryKind::closest, rays, hits, threads, in_flight);
    return py::make_tuple(std::move(t), std::move(prim), std::move(uv), std::move(steps));
}

template <class Real>
py::tuple occluded(const PyBvh& self, const std::string& kernel, const Array<Real>& origins,
                   const Array<Real>& directions, const Array<Real>& tmin, const Array<Real>& tmax, unsigned threads,
                   unsigned in_flight, bool stats) {
    const Rays<Real> rays = ray_batch(self, origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<bool> mask(n);
    std::optional<Array<std::int32_t>> steps;
    HitBatch<Real> hits;
    hits.occluded = mask.mutable_data();
    if (stats) hits.stats = steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data();
    trace_released(self, kernel, QueryKind::any, rays, hits, threads, in_flight);
    return py::make_tuple(std::move(mask), std::move(steps));
}

template <class Real>
py::tuple count(const PyBvh& self, const std::string& kernel, const Array<Real>& origins, const Array<Real>& directions,
                const Array<Real>& tmin, const Array<Real>& tmax, unsigned threads, unsigned in_flight, bool stats) {
    const Rays<Real> rays = ray_batch(self, origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<std::int32_t> counts(n);
    std::optional<Array<std::int32_t>> steps;
    HitBatch<Real> hits;
    hits.count = counts.mutable_data();
    if (stats) hits.stats = steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data();
    trace_released(self, kernel, QueryKind::count, rays, hits, threads, in_flight);
    return py::make_tuple(std::move(counts), std::move(steps));
}

template <class Real>
py::tuple intersect_all(const PyBvh& self, const std::string& kernel, const Array<Real>& origins,
                        const Array<Real>& directions, const Array<Real>& tmin, const Array<Real>& tmax,
                        unsigned threads, unsigned in_flight, bool stats) {
    const Rays<Real> rays = ray_batch(self, origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<std::int64_t> offsets(n + 1);
    std::optional<Array<std::int32_t>> steps;
    std::int32_t* steps_data = stats ? steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data() : nullptr;
    const KernelTable<Real>& table = find_kernels<Real>(kernel);
    const TraceBatch<Real> batch = table.find({QueryKind::all, self.bvh().accuracy(), self.bvh().node_form(), stats});
    const BvhView bvh = self.bvh().view();
    std::int64_t* offsets_data = offsets.mutable_data();
    std::optional<Gathering<Real>> gathering;
    {
        py::gil_scoped_release release;
        gathering.emplace(table, batch, bvh, rays.batch, rays.count, steps_data, threads, in_flight);
        gathering->write_offsets(offsets_data);
    }
    const auto total = static_cast<py::ssize_t>(offsets_data[n]);
    Array<Real> t(total), uv({total, py::ssize_t{2}});
    Array<std::int32_t> prim(total);
    const SortedHits<Real> hits = {offsets_data, t.mutable_data(), prim.mutable_data(), uv.mutable_data()};
    {
        py::gil_scoped_release release;
        gathering->sort_into(hits);
        gathering.reset();  // long lists take a while to free
    }
    return py::make_tuple(std::move(offsets), std::move(t), std::move(prim), std::move(uv), std::move(steps));
}

}  // namespace

void bind_queries(PyBvhClass& bvh) {
    const auto def = [&](const char* name, const auto& query) {
        bvh.def(name, query, py::arg("kernel"), array_arg("origins"), array_arg("directions"), array_arg("tmin"),
                array_arg("tmax"), py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("stats") = false);
    };
    for_each_precision([&]<class Real>(Real) {
        def("intersect", &intersect<Real>);
        def("occluded", &occluded<Real>);
        def("intersect_all", &intersect_all<Real>);
        def("count", &count<Real>);
    });
}

}  // namespace wive
