// The Python module: the tree and the renderer.
#include <new>
#include <optional>
#include <span>
#include <stdexcept>

#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "exact_source.h"
#include "kernels/avx512_form.h"
#include "python/bindings.h"
#include "render/render.h"

namespace wive {

Accuracy parse_accuracy(const std::string& name) {
    if (name == "fast") return Accuracy::fast;
    if (name == "watertight") return Accuracy::watertight;
    expect(name == "exact", "accuracy: expected 'fast', 'watertight' or 'exact'");
    return Accuracy::exact;
}

NodeForm parse_nodes(const std::string& name) {
    if (name == "float32") return NodeForm::float32;
    expect(name == "compressed", "nodes: expected 'float32' or 'compressed'");
    return NodeForm::compressed;
}

Quality parse_quality(const std::string& name) {
    if (name == "high") return Quality::high;
    expect(name == "medium", "quality: expected 'medium' or 'high'");
    return Quality::medium;
}

namespace {

#if defined(__clang__)
constexpr const char* compiler_name = "clang " __clang_version__;
#else
constexpr const char* compiler_name = "gcc " __VERSION__;
#endif

const char* accuracy_name(Accuracy accuracy) {
    return accuracy == Accuracy::fast ? "fast" : accuracy == Accuracy::watertight ? "watertight" : "exact";
}

Albedo parse_albedo(const std::string& name) {
    if (name == "gray") return Albedo::gray;
    if (name == "normals") return Albedo::normals;
    if (name == "faces") return Albedo::of_faces;
    expect(name == "vertices", "albedo: expected 'gray', 'normals', 'faces' or 'vertices'");
    return Albedo::of_vertices;
}

template <class Real>
std::unique_ptr<PyBvh> build(Array<Real> vertices, Array<std::int32_t> faces, const std::string& accuracy,
                             unsigned threads, int depth_limit, const std::string& nodes, const std::string& quality) {
    const BuildOptions options = {parse_accuracy(accuracy), parse_nodes(nodes), threads, depth_limit,
                                  parse_quality(quality)};
    return std::make_unique<PyBvh>(std::move(vertices), std::move(faces), options);
}

// addresses: of function and context, as ctypes has them.
ForeignTracer foreign_tracer(const std::optional<std::pair<std::uintptr_t, std::uintptr_t>>& addresses) {
    if (!addresses) return {};
    return {reinterpret_cast<ForeignTracer::Function>(addresses->first),
            reinterpret_cast<const void*>(addresses->second)};
}

Light light_of(const Array<float>& rows) {
    expect(rows.ndim() == 2 && rows.shape(0) == 5 && rows.shape(1) == 3, "light: expected shape (5, 3)");
    const auto row = [&](py::ssize_t i) { return load_vec3(rows.data(i, 0)); };
    return {row(0), row(1), row(2), row(3), row(4)};
}

const float* colours_of(const Array<float>& rows, std::size_t count) {
    expect(rows.ndim() == 2 && rows.shape(1) == 3 && static_cast<std::size_t>(rows.shape(0)) == count,
           "colours: expected shape (f, 3) or (v, 3)");
    return rows.data();
}

std::uint64_t render(const PyBvh& self, const KernelArg& kernel, const Array<float>& camera, Array<float> image,
                     int row_begin, int row_end, int samples, int bounces, const std::string& albedo,
                     std::uint32_t seed, unsigned threads, unsigned in_flight,
                     std::optional<std::pair<std::uintptr_t, std::uintptr_t>> tracer, bool check,
                     const std::optional<Array<float>>& colours, const std::optional<Array<float>>& light) {
    expect(self.bvh().precision() == Precision::float32, "render: expected a float32 scene, got float64");
    expect(camera.ndim() == 2 && camera.shape(0) == 4 && camera.shape(1) == 3, "camera: expected shape (4, 3)");
    expect(image.ndim() == 3 && image.shape(2) == 3, "image: expected shape (height, width, 3)");
    expect(0 <= row_begin && row_begin <= row_end && row_end <= image.shape(0),
           "rows: expected a range within the image");
    expect(samples > 0 && bounces >= 0, "samples, bounces: expected at least 1 and 0");
    const Mesh<float> mesh = self.mesh<float>();
    const Albedo surface = parse_albedo(albedo);
    const bool has_colours = surface == Albedo::of_faces || surface == Albedo::of_vertices;
    const std::size_t colour_count = surface == Albedo::of_faces ? mesh.face_count : mesh.vertex_count;
    expect(has_colours == colours.has_value(), "colours: expected with albedo 'faces' and 'vertices' alone");
    const auto row = [&](py::ssize_t i) { return load_vec3(camera.data(i, 0)); };
    const RenderJob job = {self.bvh().view(),
                           mesh,
                           table_of<float>(kernel),
                           self.bvh().accuracy(),
                           self.bvh().node_form(),
                           {row(0), row(1), row(2), row(3)},
                           static_cast<int>(image.shape(1)),
                           static_cast<int>(image.shape(0)),
                           samples,
                           bounces,
                           surface,
                           seed,
                           image.mutable_data(),
                           in_flight,
                           foreign_tracer(tracer),
                           light ? light_of(*light) : white_sky,
                           colours ? colours_of(*colours, colour_count) : nullptr};
    const Released released;
    if (check) {  // the arrays are the caller's, who may have changed them since the tree was built
        Threads checkers(thread_count(threads));
        check_mesh(job.mesh, checkers);
    }
    return render_rows(job, row_begin, row_end, thread_count(threads));
}

// A read-only array over memory that `owner` keeps alive.
template <class T>
py::array_t<T> view(py::handle owner, std::vector<py::ssize_t> shape, const T* data) {
    py::array_t<T> array(std::move(shape), data, owner);
    array.attr("setflags")(py::arg("write") = false);
    return array;
}

// DefaultFloats for a `with` block, on the thread that runs it.
class PyDefaultFloats {
public:
    void enter() { floats_.emplace(); }
    void exit(const py::args&) { floats_.reset(); }

private:
    std::optional<DefaultFloats> floats_;
};

constexpr std::size_t word_bytes = sizeof(std::uint32_t), unit_words = unit_bytes / word_bytes;

// Nodes or blocks of item_bytes each, as a (n, rows, columns) array of words.
py::array_t<std::uint32_t> words(py::handle owner, std::span<const std::byte> data, std::size_t item_bytes,
                                 std::size_t columns) {
    return view(owner,
                {static_cast<py::ssize_t>(data.size() / item_bytes),
                 static_cast<py::ssize_t>(item_bytes / word_bytes / columns), static_cast<py::ssize_t>(columns)},
                reinterpret_cast<const std::uint32_t*>(data.data()));
}

template <std::size_t n>
py::array_t<float> copy(const std::array<float, n>& values) {
    return py::array_t<float>(static_cast<py::ssize_t>(n), values.data());
}

unsigned long signal_thread = 0;

// Whether this is the thread in which Python handles signals.
bool handles_signals() { return PyThread_get_thread_ident() == signal_thread; }

// The function that hears how far the work of this thread is; null if there is none.
thread_local const py::function* hearer = nullptr;

// Sets it, and what was there before again in the end.
class Hearer {
public:
    explicit Hearer(const py::function* function) : before_(hearer) { hearer = function; }
    ~Hearer() { hearer = before_; }
    Hearer(const Hearer&) = delete;
    Hearer& operator=(const Hearer&) = delete;

    const py::function* before() const { return before_; }

private:
    const py::function* const before_;
};

void check_caller() {
    const py::gil_scoped_acquire lock;
    const double done = progress();
    const OtherWork called;
    const Hearer nobody(nullptr);
    if (handles_signals() && PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (const py::function* hears = nobody.before()) (*hears)(done);
}

// Calls `work`. Meanwhile `hears` is called with the fraction that is done of the core's call at hand, ten times a
// second at most.
py::object report_to(const py::function& hears, const py::function& work) {
    const Hearer scope(&hears);
    return work();
}

}  // namespace

Poll::Check caller_check() { return hearer || handles_signals() ? &check_caller : nullptr; }

}  // namespace wive

PYBIND11_MODULE(_cpu, m, pybind11::mod_gil_not_used()) {
    using namespace wive;
    m.doc() = "The compiled core of wive.";
    // pybind11 makes MemoryErrors of OutOfMemory, with its text. What the standard library throws has none for users.
    py::register_local_exception_translator([](std::exception_ptr thrown) {
        try {
            std::rethrow_exception(std::move(thrown));
        } catch (const OutOfMemory&) {
            throw;
        } catch (const std::bad_alloc&) {
            PyErr_SetString(PyExc_MemoryError, "not enough memory");
        } catch (const std::length_error&) {  // a vector larger than the address space
            PyErr_SetString(PyExc_MemoryError, "not enough memory");
        }
    });
    signal_thread = py::module_::import("threading").attr("main_thread")().attr("ident").cast<unsigned long>();
    m.def("available_memory", &available_memory, py::arg("root") = "");
    m.def("usable_cores", &usable_cores, py::arg("root") = "");
    m.def("thread_count", &thread_count, py::arg("requested") = 0);
    m.def("set_thread_count", &set_thread_count, py::arg("count"));
    m.def("report_to", &report_to, py::arg("hears"), py::arg("work"));
    m.def("expect_memory", &expect_memory, py::arg("bytes"));
    m.attr("compiler") = compiler_name;
    m.attr("exact_source") = exact_source;
    m.def("kernels", [] {
        py::dict names;
        for (const auto& [name, reason] : list_kernels()) names[py::str(name)] = reason;
        return names;
    });
    m.def("avx512_form", [] {
        find_kernels<float>("avx512.full");  // throws if they can't run
        return avx512_form();
    });
    py::class_<PyKernels>(m, "Kernels")
        .def(py::init<std::string>(), py::arg("name"))
        .def_property_readonly("name", &PyKernels::name);
    py::class_<PyDefaultFloats>(m, "DefaultFloats")
        .def(py::init<>())
        .def("__enter__", &PyDefaultFloats::enter)
        .def("__exit__", &PyDefaultFloats::exit);
    PyBvhClass bvh(m, "Bvh");
    for_each_precision([&]<class Real>(Real) {
        bvh.def(py::init(&build<Real>), array_arg("vertices"), array_arg("faces"), py::arg("accuracy") = "watertight",
                py::arg("threads") = 0, py::arg("depth_limit") = max_depth, py::arg("nodes") = "float32",
                py::arg("quality") = "medium");
        bvh.def(
            "refitted",
            [](const PyBvh& self, const Array<Real>& vertices, unsigned threads) {
                return std::make_unique<PyBvh>(self, vertices, threads);
            },
            array_arg("vertices"), py::arg("threads") = 0);
    });
    bvh.def_property_readonly("vertices", &PyBvh::vertices)
        .def_property_readonly("precision",
                               [](const PyBvh& self) {
                                   return self.unverified().precision() == Precision::float32 ? "float32" : "float64";
                               })
        .def_property_readonly("nodes",
                               [](const py::object& self) {
                                   const Bvh& bvh = self.cast<const PyBvh&>().bvh();
                                   return words(self, bvh.nodes(), bvh.node_bytes(), node_width);
                               })
        .def_property_readonly("blocks",
                               [](const py::object& self) {
                                   const Bvh& bvh = self.cast<const PyBvh&>().bvh();
                                   if (bvh.precision() == Precision::float64)
                                       return words(self, bvh.blocks(), sizeof(TriangleBlockOf<double>), block_width);
                                   if (bvh.node_form() == NodeForm::compressed)
                                       return words(self, bvh.blocks(), unit_bytes, unit_words);
                                   return words(self, bvh.blocks(), sizeof(TriangleBlock), block_width);
                               })
        .def_property_readonly(
            "units",
            [](const py::object& self) {
                const Bvh& bvh = self.cast<const PyBvh&>().bvh();
                return view(self,
                            {static_cast<py::ssize_t>(bvh.bytes() / unit_bytes), static_cast<py::ssize_t>(unit_words)},
                            reinterpret_cast<const std::uint32_t*>(bvh.view().units));
            })
        .def_property_readonly("center",
                               [](const PyBvh& self) {
                                   const BvhView v = self.unverified().view();
                                   return copy(std::array{v.center[0], v.center[1], v.center[2]});
                               })
        .def_property_readonly("extent",
                               [](const PyBvh& self) {
                                   const BvhView v = self.unverified().view();
                                   return copy(std::array{v.extent[0], v.extent[1], v.extent[2]});
                               })
        .def_property_readonly("bounds",
                               [](const PyBvh& self) -> py::array {
                                   const DefaultFloats floats;  // for the conversion to float32
                                   py::array_t<double> bounds({2, 3}, self.unverified().bounds()[0].data());
                                   if (self.unverified().precision() == Precision::float64) return bounds;
                                   return py::array_t<float>(bounds);
                               })
        .def_property_readonly("far_distance",
                               [](const PyBvh& self) {
                                   const DefaultFloats floats;
                                   return self.unverified().distant().far;
                               })
        .def_property_readonly("accuracy",
                               [](const PyBvh& self) { return accuracy_name(self.unverified().accuracy()); })
        .def_property_readonly("node_form",
                               [](const PyBvh& self) {
                                   return self.unverified().node_form() == NodeForm::float32 ? "float32" : "compressed";
                               })
        .def_property_readonly("depth", [](const PyBvh& self) { return self.unverified().depth(); })
        .def_property_readonly("memory", [](const PyBvh& self) { return self.unverified().bytes(); })
        .def_property_readonly("sah",
                               [](const PyBvh& self) {
                                   const DefaultFloats floats;
                                   const Bvh::Sah sah = self.bvh().sah();
                                   return py::make_tuple(sah.nodes, sah.blocks);
                               })
        .def("render_rows", &render, py::arg("kernel"), array_arg("camera"), array_arg("image"), py::arg("row_begin"),
             py::arg("row_end"), py::arg("samples"), py::arg("bounces"), py::arg("albedo"), py::arg("seed") = 0,
             py::arg("threads") = 0, py::arg("in_flight") = 0, py::arg("tracer") = py::none(), py::arg("check") = true,
             py::arg("colours").noconvert() = py::none(), py::arg("light").noconvert() = py::none());
    bind_queries(bvh);
    bind_closest(m, bvh);
    bind_surface(m);
    bind_segments(m);
    bind_distant(m);
    bind_stored(m, bvh);
    bind_streams(m);
    bind_parts(m, bvh);
}
