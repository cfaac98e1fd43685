// The queries of a tree, as Python calls them.
#include <optional>

#include "bindings.h"
#include "dispatch.h"
#include "gather.h"
#include "trace.h"

namespace wive {
namespace {

struct Rays {
    RayBatch batch;
    std::size_t count;
};

Rays ray_batch(const Array<float>& origins, const Array<float>& directions, const Array<float>& tmin,
               const Array<float>& tmax) {
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    expect_shape(directions, 3, "directions: expected shape (n, 3)");
    const py::ssize_t n = origins.shape(0);
    expect(directions.shape(0) == n, "directions: expected as many as origins");
    expect(tmin.size() == 1 || tmin.size() == n, "tmin: expected one value or one a ray");
    expect(tmax.size() == 1 || tmax.size() == n, "tmax: expected one value or one a ray");
    const auto stride = [](const Array<float>& a) { return static_cast<std::size_t>(a.size() == 1 ? 0 : 1); };
    return {{origins.data(), directions.data(), tmin.data(), tmax.data(), stride(tmin), stride(tmax)},
            static_cast<std::size_t>(n)};
}

// Traces the rays with the interpreter lock released.
void trace_released(const PyBvh& self, const std::string& kernel, QueryKind query, const Rays& rays,
                    const HitBatch& hits, unsigned threads, unsigned in_flight) {
    const KernelTable& table = find_kernels(kernel);
    const TraceBatch batch = table.find({query, self.bvh().accuracy(), self.bvh().node_form(), hits.stats != nullptr});
    const BvhView bvh = self.bvh().view();
    py::gil_scoped_release release;
    trace(table, batch, bvh, rays.batch, hits, rays.count, threads, in_flight);
}

py::tuple intersect(const PyBvh& self, const std::string& kernel, const Array<float>& origins,
                    const Array<float>& directions, const Array<float>& tmin, const Array<float>& tmax, unsigned threads,
                    unsigned in_flight, bool stats) {
    const Rays rays = ray_batch(origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<float> t(n), uv({n, py::ssize_t{2}});
    Array<std::int32_t> prim(n);
    std::optional<Array<std::int32_t>> steps;
    HitBatch hits;
    hits.t = t.mutable_data();
    hits.prim = prim.mutable_data();
    hits.uv = uv.mutable_data();
    if (stats) hits.stats = steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data();
    trace_released(self, kernel, QueryKind::closest, rays, hits, threads, in_flight);
    return py::make_tuple(std::move(t), std::move(prim), std::move(uv), std::move(steps));
}

py::tuple occluded(const PyBvh& self, const std::string& kernel, const Array<float>& origins,
                   const Array<float>& directions, const Array<float>& tmin, const Array<float>& tmax, unsigned threads,
                   unsigned in_flight, bool stats) {
    const Rays rays = ray_batch(origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<bool> mask(n);
    std::optional<Array<std::int32_t>> steps;
    HitBatch hits;
    hits.occluded = mask.mutable_data();
    if (stats) hits.stats = steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data();
    trace_released(self, kernel, QueryKind::any, rays, hits, threads, in_flight);
    return py::make_tuple(std::move(mask), std::move(steps));
}

py::tuple count(const PyBvh& self, const std::string& kernel, const Array<float>& origins,
                const Array<float>& directions, const Array<float>& tmin, const Array<float>& tmax, unsigned threads,
                unsigned in_flight, bool stats) {
    const Rays rays = ray_batch(origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<std::int32_t> counts(n);
    std::optional<Array<std::int32_t>> steps;
    HitBatch hits;
    hits.count = counts.mutable_data();
    if (stats) hits.stats = steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data();
    trace_released(self, kernel, QueryKind::count, rays, hits, threads, in_flight);
    return py::make_tuple(std::move(counts), std::move(steps));
}

py::tuple intersect_all(const PyBvh& self, const std::string& kernel, const Array<float>& origins,
                        const Array<float>& directions, const Array<float>& tmin, const Array<float>& tmax,
                        unsigned threads, unsigned in_flight, bool stats) {
    const Rays rays = ray_batch(origins, directions, tmin, tmax);
    const py::ssize_t n = origins.shape(0);
    Array<std::int64_t> offsets(n + 1);
    std::optional<Array<std::int32_t>> steps;
    std::int32_t* steps_data = stats ? steps.emplace(std::vector<py::ssize_t>{n, 3}).mutable_data() : nullptr;
    const KernelTable& table = find_kernels(kernel);
    const TraceBatch batch = table.find({QueryKind::all, self.bvh().accuracy(), self.bvh().node_form(), stats});
    const BvhView bvh = self.bvh().view();
    std::int64_t* offsets_data = offsets.mutable_data();
    std::optional<Gathering> gathering;
    {
        py::gil_scoped_release release;
        gathering.emplace(table, batch, bvh, rays.batch, rays.count, steps_data, threads, in_flight);
        gathering->write_offsets(offsets_data);
    }
    const auto total = static_cast<py::ssize_t>(offsets_data[n]);
    Array<float> t(total), uv({total, py::ssize_t{2}});
    Array<std::int32_t> prim(total);
    const SortedHits hits = {offsets_data, t.mutable_data(), prim.mutable_data(), uv.mutable_data()};
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
    def("intersect", &intersect);
    def("occluded", &occluded);
    def("intersect_all", &intersect_all);
    def("count", &count);
}

}  // namespace wive
