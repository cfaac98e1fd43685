// The ray queries of a tree, as Python calls them.
#include <optional>

#include "core/memory.h"
#include "core/progress.h"
#include "kernels/hit_collector.h"
#include "kernels/trace.h"
#include "python/bindings.h"

namespace wive {
namespace {

// Where the sorting of all hits begins, in fractions of the query's time, about.
constexpr double sort_begin = 0.8;

// A view of the caller's arrays, whose shapes it checks.
template <class Real>
RayBatch<Real> ray_batch(const Array<Real>& origins, const Array<Real>& directions, const Array<Real>& tmin,
                         const Array<Real>& tmax) {
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    expect_shape(directions, 3, "directions: expected shape (n, 3)");
    const py::ssize_t n = origins.shape(0);
    expect(directions.shape(0) == n, "directions: expected as many as origins");
    expect(tmin.size() == 1 || tmin.size() == n, "tmin: expected one value or one per ray");
    expect(tmax.size() == 1 || tmax.size() == n, "tmax: expected one value or one per ray");
    const auto stride = [](const Array<Real>& a) { return static_cast<std::size_t>(a.size() == 1 ? 0 : 1); };
    return {origins.data(), directions.data(), tmin.data(), tmax.data(), stride(tmin), stride(tmax)};
}

// The arguments of a query. All queries have the same.
template <class Real>
struct QueryCall {
    const PyBvh& tree;
    const KernelTable<Real>& kernels;
    RayBatch<Real> rays;
    py::ssize_t count;
    unsigned threads, in_flight;
    bool stats;
    bool touching = false;      // of several hits: every triangle touched, not every crossing
    std::size_t max_bytes = 0;  // intersect_all: what hits may take

    std::size_t size() const { return static_cast<std::size_t>(count); }
    // Throws OutOfMemory if there is no room for outputs of so many bytes per ray.
    void expect_room(std::size_t ray_bytes) const {
        expect_memory(size() * (ray_bytes + (stats ? 3 * sizeof(std::int32_t) : 0)));
    }
    TraceBatch<Real> kernel(QueryKind query) const {
        return kernels.find({query, tree.bvh().accuracy(), tree.bvh().node_form(), stats});
    }
};

// The array of a query's step counts. Python gets None unless the caller wants them.
class StepCounts {
public:
    template <class Real>
    explicit StepCounts(const QueryCall<Real>& call) {
        if (call.stats) array_.emplace(new_array<std::int32_t>({call.count, 3}));
    }
    std::int32_t* data() { return array_ ? array_->mutable_data() : nullptr; }
    std::optional<Array<std::int32_t>> take() { return std::move(array_); }

private:
    std::optional<Array<std::int32_t>> array_;
};

// Traces the rays with the interpreter lock released.
template <class Real>
void trace_released(const QueryCall<Real>& call, QueryKind query, const HitBatch<Real>& hits) {
    const TraceBatch<Real> kernel = call.kernel(query);
    const BvhView bvh = call.tree.bvh().view();
    const Released released;
    trace(call.kernels, kernel, bvh, call.rays, hits, call.size(), call.threads, call.in_flight);
}

template <class Real>
py::tuple intersect(const QueryCall<Real>& call) {
    call.expect_room(3 * sizeof(Real) + sizeof(std::int32_t));
    auto t = new_array<Real>({call.count}), uv = new_array<Real>({call.count, 2});
    auto prim = new_array<std::int32_t>({call.count});
    StepCounts steps(call);
    HitBatch<Real> hits;
    hits.t = t.mutable_data();
    hits.prim = prim.mutable_data();
    hits.uv = uv.mutable_data();
    hits.stats = steps.data();
    trace_released(call, QueryKind::closest, hits);
    return py::make_tuple(std::move(t), std::move(prim), std::move(uv), steps.take());
}

template <class Real>
py::tuple occluded(const QueryCall<Real>& call) {
    call.expect_room(sizeof(bool));
    auto mask = new_array<bool>({call.count});
    StepCounts steps(call);
    HitBatch<Real> hits;
    hits.occluded = mask.mutable_data();
    hits.stats = steps.data();
    trace_released(call, QueryKind::any, hits);
    return py::make_tuple(std::move(mask), steps.take());
}

template <class Real>
py::tuple count(const QueryCall<Real>& call) {
    call.expect_room(sizeof(std::int32_t));
    auto counts = new_array<std::int32_t>({call.count});
    StepCounts steps(call);
    HitBatch<Real> hits;
    hits.count = counts.mutable_data();
    hits.crossings = !call.touching;
    hits.stats = steps.data();
    trace_released(call, QueryKind::count, hits);
    return py::make_tuple(std::move(counts), steps.take());
}

template <class Real>
py::tuple intersect_all(const QueryCall<Real>& call) {
    call.expect_room(sizeof(std::int64_t) + sizeof(std::int32_t));
    auto offsets = new_array<std::int64_t>({call.count + 1});
    StepCounts steps(call);
    const TraceBatch<Real> kernel = call.kernel(QueryKind::all);
    const BvhView bvh = call.tree.bvh().view();
    std::int32_t* steps_data = steps.data();
    std::int64_t* offsets_data = offsets.mutable_data();
    std::optional<HitCollector<Real>> collector;
    {
        const Released released;
        const ProgressPart tracing(0, sort_begin);
        collector.emplace(call.kernels, kernel, bvh, call.rays, call.size(), !call.touching, steps_data, call.threads,
                          call.in_flight, call.max_bytes);
        collector->write_offsets(offsets_data);
    }
    const auto total = static_cast<py::ssize_t>(offsets_data[call.count]);
    auto t = new_array<Real>({total}), uv = new_array<Real>({total, 2});
    auto prim = new_array<std::int32_t>({total});
    const SortedHits<Real> hits = {offsets_data, t.mutable_data(), prim.mutable_data(), uv.mutable_data()};
    {
        const Released released;
        const ProgressPart sorting(sort_begin, 1);
        collector->sort_into(hits);
        collector.reset();  // here, because long lists take a while to free
    }
    return py::make_tuple(std::move(offsets), std::move(t), std::move(prim), std::move(uv), steps.take());
}

// More: the types of the arguments that not every query has, the last of QueryCall; arg: their names and defaults.
template <class Real, class... More, class... Arg>
void define_query(PyBvhClass& bvh, const char* name, py::tuple (*query)(const QueryCall<Real>&), const Arg&... arg) {
    static_assert(sizeof...(More) == sizeof...(Arg));
    const auto call = [query](const PyBvh& self, const KernelArg& kernel, const GivenArray<Real>& origins,
                              const GivenArray<Real>& directions, const GivenArray<Real>& tmin,
                              const GivenArray<Real>& tmax, unsigned threads, unsigned in_flight, bool stats,
                              More... more) {
        self.expect_precision<Real>();
        const RayBatch<Real> rays = ray_batch(origins.array, directions.array, tmin.array, tmax.array);
        return query({self, table_of<Real>(kernel), rays, origins.array.shape(0), threads, in_flight, stats, more...});
    };
    bvh.def(name, call, py::arg("kernel"), py::arg("origins"), py::arg("directions"), py::arg("tmin"), py::arg("tmax"),
            py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("stats") = false, arg...);
}

// The data of an array (n, 3) that needs neither conversion nor copying, and its rows; null for all other objects.
template <class Real>
const Real* ready_rows(py::handle object, py::ssize_t& count) {
    const auto& numpy = py::detail::npy_api::get();
    if (Py_TYPE(object.ptr()) != numpy.PyArray_Type_ || !Array<Real>::check_(object)) return nullptr;
    if (!py::detail::check_flags(object.ptr(), py::detail::npy_api::NPY_ARRAY_ALIGNED_)) return nullptr;
    const auto& array = *py::detail::array_proxy(object.ptr());
    if (array.nd != 2 || array.dimensions[1] != 3) return nullptr;
    count = array.dimensions[0];
    return reinterpret_cast<const Real*>(array.data);
}

// Sets a limit given as a Python float that Real holds; false for all other objects.
template <class Real>
bool set_limit(py::handle object, Real& limit) {
    if (!PyFloat_CheckExact(object.ptr())) return false;
    const double given = PyFloat_AS_DOUBLE(object.ptr());
    limit = static_cast<Real>(given);
    return limit == given;
}

// The query's result but for step counts, or None if an argument is not ready as it is: one ray is traced in less time
// than its arguments are checked in Python.
template <class Real>
py::object query_ready(const PyBvh& self, const PyKernels& kernels, py::handle origins, py::handle directions,
                       py::handle tmin, py::handle tmax, py::tuple (*query)(const QueryCall<Real>&)) {
    py::ssize_t count = 0, others = 0;
    Real low, high;
    const Real* from = ready_rows<Real>(origins, count);
    const Real* along = ready_rows<Real>(directions, others);
    if (!from || !along || count != others || !set_limit(tmin, low) || !set_limit(tmax, high)) return py::none();
    if constexpr (std::is_same_v<Real, float>)
        if (self.bvh().accuracy() != Accuracy::exact &&
            self.bvh().distant().may_hold(from, static_cast<std::size_t>(count)))
            return py::none();
    return query({self, kernels.table<Real>(), {from, along, &low, &high, 0, 0}, count, 0, 0, false});
}

void define_ready_query(PyBvhClass& bvh, const char* name, py::tuple (*in_floats)(const QueryCall<float>&),
                        py::tuple (*in_doubles)(const QueryCall<double>&)) {
    const auto call = [=](const PyBvh& self, const PyKernels& kernels, py::handle origins, py::handle directions,
                          py::handle tmin, py::handle tmax) {
        return std::holds_alternative<Array<float>>(self.vertices())
                   ? query_ready<float>(self, kernels, origins, directions, tmin, tmax, in_floats)
                   : query_ready<double>(self, kernels, origins, directions, tmin, tmax, in_doubles);
    };
    bvh.def(name, call, py::arg("kernel"), py::arg("origins"), py::arg("directions"), py::arg("tmin"), py::arg("tmax"));
}

}  // namespace

void bind_queries(PyBvhClass& bvh) {
    for_each_precision([&]<class Real>(Real) {
        define_query<Real>(bvh, "intersect", intersect);
        define_query<Real>(bvh, "occluded", occluded);
        define_query<Real, bool, std::size_t>(bvh, "intersect_all", intersect_all, py::arg("touching") = false,
                                              py::arg("max_bytes") = 0);
        define_query<Real, bool>(bvh, "count", count, py::arg("touching") = false);
    });
    define_ready_query(bvh, "intersect_ready", intersect, intersect);
    define_ready_query(bvh, "occluded_ready", occluded, occluded);
    define_ready_query(bvh, "count_ready", count, count);
}

}  // namespace wive
