// The Python face of the core. Arguments are checked in Python (wive/scene.py); here only what memory safety needs.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "builder.h"
#include "dispatch.h"
#include "exact_source.h"
#include "gather.h"
#include "parallel.h"
#include "render.h"
#include "trace.h"

namespace py = pybind11;

namespace wive {
namespace {

template <class T>
using Array = py::array_t<T, py::array::c_style>;

#if defined(__clang__)
constexpr const char* compiler_name = "clang " __clang_version__;
#else
constexpr const char* compiler_name = "gcc " __VERSION__;
#endif

void expect(bool condition, const char* message) {
    if (!condition) throw std::invalid_argument(message);
}

template <class T>
void expect_shape(const Array<T>& array, py::ssize_t columns, const char* message) {
    expect(array.ndim() == 2 && array.shape(1) == columns, message);
}

Accuracy parse_accuracy(const std::string& name) {
    if (name == "fast") return Accuracy::fast;
    if (name == "watertight") return Accuracy::watertight;
    expect(name == "exact", "accuracy: expected 'fast', 'watertight' or 'exact'");
    return Accuracy::exact;
}

const char* accuracy_name(Accuracy accuracy) {
    return accuracy == Accuracy::fast ? "fast" : accuracy == Accuracy::watertight ? "watertight" : "exact";
}

NodeForm parse_nodes(const std::string& name) {
    if (name == "float32") return NodeForm::float32;
    expect(name == "compressed", "nodes: expected 'float32' or 'compressed'");
    return NodeForm::compressed;
}

ChildOrder parse_order(const std::string& name) {
    if (name == "treelet") return ChildOrder::treelet;
    if (name == "diagonal") return ChildOrder::diagonal;
    if (name == "slots") return ChildOrder::slots;
    expect(name == "none", "order: expected 'treelet', 'diagonal', 'slots' or 'none'");
    return ChildOrder::none;
}

// The tree together with the arrays it was built from, which rendering reads.
class PyBvh {
public:
    PyBvh(Array<float> vertices, Array<std::int32_t> faces, const std::string& accuracy, const std::string& order,
          unsigned threads, int depth_limit, const std::string& nodes)
        : vertices_(std::move(vertices)), faces_(std::move(faces)) {
        expect_shape(vertices_, 3, "vertices: expected shape (v, 3)");
        expect_shape(faces_, 3, "faces: expected shape (f, 3)");
        expect(depth_limit >= 1 && depth_limit <= max_depth, "depth_limit: expected 1 to 64");
        const BuildOptions options = {parse_accuracy(accuracy), parse_nodes(nodes), parse_order(order), threads, depth_limit};
        const Mesh view = mesh();
        py::gil_scoped_release release;
        bvh_ = std::make_unique<Bvh>(view, options);
    }

    const Bvh& bvh() const { return *bvh_; }
    Mesh mesh() const {
        return {vertices_.data(), static_cast<std::size_t>(vertices_.shape(0)), faces_.data(),
                static_cast<std::size_t>(faces_.shape(0))};
    }

private:
    Array<float> vertices_;
    Array<std::int32_t> faces_;
    std::unique_ptr<Bvh> bvh_;
};

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

// Function and context as ctypes gives their addresses.
ForeignTracer foreign_tracer(const std::optional<std::pair<std::uintptr_t, std::uintptr_t>>& addresses) {
    if (!addresses) return {};
    return {reinterpret_cast<ForeignTracer::Function>(addresses->first), reinterpret_cast<const void*>(addresses->second)};
}

std::uint64_t render(const PyBvh& self, const std::string& kernel, const Array<float>& camera, Array<float> image,
                     int row_begin, int row_end, int samples, int bounces, const std::string& albedo, std::uint32_t seed,
                     unsigned threads, unsigned in_flight,
                     std::optional<std::pair<std::uintptr_t, std::uintptr_t>> tracer) {
    expect(camera.ndim() == 2 && camera.shape(0) == 4 && camera.shape(1) == 3, "camera: expected shape (4, 3)");
    expect(image.ndim() == 3 && image.shape(2) == 3, "image: expected shape (height, width, 3)");
    expect(0 <= row_begin && row_begin <= row_end && row_end <= image.shape(0), "rows: expected a range within the image");
    expect(samples > 0 && bounces >= 0, "samples, bounces: expected at least 1 and 0");
    expect(albedo == "gray" || albedo == "normals", "albedo: expected 'gray' or 'normals'");
    const auto row = [&](py::ssize_t i) { return load_vec3(camera.data(i, 0)); };
    const RenderJob job = {self.bvh().view(),
                           self.mesh(),
                           find_kernels(kernel),
                           self.bvh().accuracy(),
                           self.bvh().node_form(),
                           {row(0), row(1), row(2), row(3)},
                           static_cast<int>(image.shape(1)),
                           static_cast<int>(image.shape(0)),
                           samples,
                           bounces,
                           albedo == "normals" ? Albedo::normals : Albedo::gray,
                           seed,
                           image.mutable_data(),
                           in_flight,
                           foreign_tracer(tracer)};
    py::gil_scoped_release release;
    check_mesh(job.mesh, thread_count(threads));  // its arrays are the caller's, who may have changed them since
    return render_rows(job, row_begin, row_end, thread_count(threads));
}

// A read-only array over memory that `owner` keeps alive.
template <class T>
py::array_t<T> view(py::handle owner, std::vector<py::ssize_t> shape, const T* data) {
    py::array_t<T> array(std::move(shape), data, owner);
    array.attr("setflags")(py::arg("write") = false);
    return array;
}

// Nodes or blocks as words, in rows of so many.
py::array_t<std::uint32_t> rows(py::handle owner, std::span<const std::byte> data, std::size_t each, std::size_t columns) {
    return view(owner,
                {static_cast<py::ssize_t>(data.size() / each), static_cast<py::ssize_t>(each / 4 / columns),
                 static_cast<py::ssize_t>(columns)},
                reinterpret_cast<const std::uint32_t*>(data.data()));
}

template <std::size_t n>
py::array_t<float> copy(const std::array<float, n>& values) {
    return py::array_t<float>(static_cast<py::ssize_t>(n), values.data());
}

}  // namespace
}  // namespace wive

PYBIND11_MODULE(_cpu, m, py::mod_gil_not_used()) {
    using namespace wive;
    m.doc() = "The compiled core of wive.";
    m.attr("compiler") = compiler_name;
    m.attr("exact_source") = exact_source;
    m.def("kernels", [] {
        py::dict names;
        for (const auto& [name, reason] : list_kernels()) names[py::str(name)] = reason;
        return names;
    });
    const auto array = [](const char* name) { return py::arg(name).noconvert(); };
    py::class_<PyBvh>(m, "Bvh")
        .def(py::init<Array<float>, Array<std::int32_t>, const std::string&, const std::string&, unsigned, int,
                      const std::string&>(),
             array("vertices"), array("faces"), py::arg("accuracy") = "watertight", py::arg("order") = "treelet",
             py::arg("threads") = 0, py::arg("depth_limit") = max_depth, py::arg("nodes") = "float32")
        .def_property_readonly("nodes", [](py::object self) {
            const Bvh& bvh = self.cast<const PyBvh&>().bvh();
            return rows(self, bvh.nodes(), bvh.node_bytes(), 8);
        })
        .def_property_readonly("blocks", [](py::object self) {
            const Bvh& bvh = self.cast<const PyBvh&>().bvh();
            if (bvh.node_form() == NodeForm::compressed) return rows(self, bvh.blocks(), unit_bytes, 8);
            return rows(self, bvh.blocks(), sizeof(TriangleBlock), 4);
        })
        .def_property_readonly("units", [](py::object self) {
            const Bvh& bvh = self.cast<const PyBvh&>().bvh();
            return view(self, {static_cast<py::ssize_t>(bvh.bytes() / unit_bytes), 8},
                        reinterpret_cast<const std::uint32_t*>(bvh.view().units));
        })
        .def_property_readonly("center", [](const PyBvh& self) {
            const BvhView v = self.bvh().view();
            return copy(std::array{v.center[0], v.center[1], v.center[2]});
        })
        .def_property_readonly("extent", [](const PyBvh& self) {
            const BvhView v = self.bvh().view();
            return copy(std::array{v.extent[0], v.extent[1], v.extent[2]});
        })
        .def_property_readonly("bounds", [](const PyBvh& self) {
            return py::array_t<float>({2, 3}, self.bvh().bounds()[0].data());
        })
        .def_property_readonly("accuracy", [](const PyBvh& self) {
            return accuracy_name(self.bvh().accuracy());
        })
        .def_property_readonly("node_form", [](const PyBvh& self) {
            return self.bvh().node_form() == NodeForm::float32 ? "float32" : "compressed";
        })
        .def_property_readonly("depth", [](const PyBvh& self) { return self.bvh().depth(); })
        .def_property_readonly("memory", [](const PyBvh& self) {
            return self.bvh().bytes();
        })
        .def_property_readonly("sah", [](const PyBvh& self) {
            const Bvh::Sah sah = self.bvh().sah();
            return py::make_tuple(sah.nodes, sah.blocks);
        })
        .def("intersect", &intersect, py::arg("kernel"), array("origins"), array("directions"), array("tmin"),
             array("tmax"), py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("stats") = false)
        .def("occluded", &occluded, py::arg("kernel"), array("origins"), array("directions"), array("tmin"),
             array("tmax"), py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("stats") = false)
        .def("intersect_all", &intersect_all, py::arg("kernel"), array("origins"), array("directions"), array("tmin"),
             array("tmax"), py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("stats") = false)
        .def("count", &count, py::arg("kernel"), array("origins"), array("directions"), array("tmin"),
             array("tmax"), py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("stats") = false)
        .def("render_rows", &render, py::arg("kernel"), array("camera"), array("image"), py::arg("row_begin"),
             py::arg("row_end"), py::arg("samples"), py::arg("bounces"), py::arg("albedo"), py::arg("seed") = 0,
             py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("tracer") = py::none());
}
