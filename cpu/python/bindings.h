// What the binding files share. Arguments are checked in Python (wive/_internal/arguments.py); the bindings check only
// what memory safety needs.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <variant>

#include "build/builder.h"
#include "build/part_mover.h"
#include "build/winding.h"
#include "core/default_floats.h"
#include "core/poll.h"
#include "kernels/dispatch.h"

namespace wive {

namespace py = pybind11;

template <class T>
using Array = py::array_t<T, py::array::c_style>;

template <class T>
std::span<const std::byte> bytes_of(const Array<T>& array) {
    return std::as_bytes(std::span(array.data(), static_cast<std::size_t>(array.size())));
}

// An array argument that is not converted: it must have the dtype and the layout.
inline py::arg array_arg(const char* name) { return py::arg(name).noconvert(); }

// An array argument as queries take it. pybind11's own makes two arrays for each argument, which takes longer than
// tracing one ray: an empty one to begin with, and a new one of the argument.
template <class T>
struct GivenArray {
    Array<T> array;
};

// A new array, not filled. pybind11's own way takes as long as tracing one ray.
template <class T, std::size_t axes>
Array<T> new_array(const py::ssize_t (&shape)[axes]) {
    const auto& numpy = py::detail::npy_api::get();
    PyObject* array = numpy.PyArray_NewFromDescr_(numpy.PyArray_Type_, py::dtype::of<T>().release().ptr(),
                                                  static_cast<int>(axes), shape, nullptr, nullptr, 0, nullptr);
    if (!array) throw py::error_already_set();
    return py::reinterpret_steal<Array<T>>(array);
}

inline void expect(bool condition, const char* message) {
    if (!condition) throw std::invalid_argument(message);
}

template <class T>
void expect_shape(const Array<T>& array, py::ssize_t columns, const char* message) {
    expect(array.ndim() == 2 && array.shape(1) == columns, message);
}

// What work asks on this thread: it throws Python's exception if a signal's handler raised one, KeyboardInterrupt
// usually, or the function did that hears of progress. Null if this thread handles no signals and nobody hears.
Poll::Check caller_check();

// Releases the interpreter lock, and computes in the core's own floating-point environment meanwhile. Ctrl-C ends the
// work, if it is shared out by Threads.
struct Released {
    py::gil_scoped_release release;
    Poll poll{caller_check()};
    DefaultFloats floats;
};

using Checksums = std::array<std::uint64_t, 3>;  // of units, vertices and faces

// Where a tree lies that was not built here: in a file or in shared memory.
struct Stored {
    Array<std::uint8_t> units;  // (bytes,), keeps the memory
    Checksums checksums;        // as the file states them
    std::string name;           // of the file, for errors
    py::object source;          // Python's record of it

    std::span<const std::byte> bytes() const { return bytes_of(units); }
};

// A tree together with the arrays it was built from, which rendering reads.
class PyBvh {
public:
    template <class Real>
    PyBvh(Array<Real> vertices, Array<std::int32_t> faces, const BuildOptions& options)
        : vertices_(std::move(vertices)), faces_(std::move(faces)), options_(options) {
        expect_shape(std::get<Array<Real>>(vertices_), 3, "vertices: expected shape (v, 3)");
        expect_shape(faces_, 3, "faces: expected shape (f, 3)");
        expect(options.depth_limit >= 1 && options.depth_limit <= max_depth, "depth_limit: expected 1 to 64");
        const Mesh view = mesh<Real>();
        const Released released;
        bvh_ = std::make_unique<Bvh>(view, options_);
    }

    // The tree of `other` over moved vertices: refitted, or built anew if it can't be.
    template <class Real>
    PyBvh(const PyBvh& other, Array<Real> vertices, unsigned threads)
        : vertices_(std::move(vertices)), faces_(other.faces_), options_(other.options_) {
        other.expect_precision<Real>();
        expect_shape(std::get<Array<Real>>(vertices_), 3, "vertices: expected shape (v, 3)");
        options_.threads = threads;
        const Mesh view = mesh<Real>();
        const Bvh& old = other.bvh();
        const Released released;
        bvh_ = old.refitted(view, threads);
        if (!bvh_) bvh_ = std::make_unique<Bvh>(view, options_);
    }

    // A stored tree, whose nodes and blocks are those of `stored`. They and the mesh are verified before they are used.
    template <class Real>
    PyBvh(Array<Real> vertices, Array<std::int32_t> faces, const BuildOptions& options, const TreeFacts& facts,
          Stored stored)
        : vertices_(std::move(vertices)), faces_(std::move(faces)), options_(options), stored_(std::move(stored)) {
        expect_shape(std::get<Array<Real>>(vertices_), 3, "vertices: expected shape (v, 3)");
        expect_shape(faces_, 3, "faces: expected shape (f, 3)");
        const std::span<const std::byte> units = stored_->bytes();
        expect(facts.depth >= 1 && facts.depth <= max_depth, "depth: expected 1 to 64");
        expect(reinterpret_cast<std::uintptr_t>(units.data()) % alignof(Node) == 0 && units.size() % unit_bytes == 0 &&
                   units.size() / unit_bytes <= max_units,
               "units: expected whole units at a multiple of 64 bytes");
        expect(facts.node_count >= 1 && facts.node_count <= units.size() / facts.node_bytes(),
               "node_count: expected a number of nodes that units hold");
        bvh_ = std::make_unique<Bvh>(facts, units);
        is_verified_ = false;
    }

    // Verifies a stored tree at the first call, which needs the interpreter lock; throws if it is damaged.
    const Bvh& bvh() const {
        if (!is_verified_.load(std::memory_order_acquire)) [[unlikely]]
            verify();
        return *bvh_;
    }
    // For what is not in nodes, blocks or the mesh.
    const Bvh& unverified() const { return *bvh_; }
    // What a stored tree came from; None for others.
    py::object source() const { return stored_ ? stored_->source : py::none(); }
    // Of units, vertices and faces. Verifies nothing.
    Checksums checksums() const;
    const std::variant<Array<float>, Array<double>>& vertices() const { return vertices_; }
    template <class Real>
    Mesh<Real> mesh() const {
        const auto& vertices = std::get<Array<Real>>(vertices_);
        return {vertices.data(), static_cast<std::size_t>(vertices.shape(0)), faces_.data(),
                static_cast<std::size_t>(faces_.shape(0))};
    }
    // Throws unless the tree was built from vertices of Real.
    template <class Real>
    void expect_precision() const {
        expect(std::holds_alternative<Array<Real>>(vertices_),
               precision_of<Real> == Precision::float32
                   ? "expected arrays in float64, as the vertices are, got float32"
                   : "expected arrays in float32, as the vertices are, got float64");
    }

    // Made by the first call, for scenes that are asked for winding numbers.
    template <class Real>
    const WindingTable<Real>& winding() const {
        WindingCache& cache = *winding_;
        std::call_once(cache.made, [&] { cache.table.emplace<Winding<Real>>(new WindingTable(bvh(), mesh<Real>())); });
        return *std::get<Winding<Real>>(cache.table);
    }

    // What moves single meshes of the tree, ready for mesh i; null before prepare_part.
    template <class Real>
    PartMover<Real>* part_mover() {
        auto* mover = std::get_if<Mover<Real>>(&mover_);
        return mover ? mover->get() : nullptr;
    }
    // first_faces: where the faces of each mesh begin, and how many there are.
    template <class Real>
    void prepare_part(const Array<std::int32_t>& first_faces, std::size_t i);
    // PartMover::move for these vertices, which take the place of the tree's own if it returns true.
    template <class Real>
    bool move_part(Array<Real> vertices, PartMover<Real>& mover, std::size_t i, Threads& threads);

private:
    void verify() const;

    template <class Real>
    using Winding = std::unique_ptr<const WindingTable<Real>>;
    struct WindingCache {
        std::once_flag made;
        std::variant<Winding<float>, Winding<double>> table;
    };
    template <class Real>
    using Mover = std::unique_ptr<PartMover<Real>>;

    std::variant<Array<float>, Array<double>> vertices_;
    Array<std::int32_t> faces_;
    BuildOptions options_;
    std::optional<Stored> stored_;
    std::unique_ptr<Bvh> bvh_;
    mutable std::atomic<bool> is_verified_ = true;
    mutable std::unique_ptr<WindingCache> winding_ = std::make_unique<WindingCache>();
    std::variant<Mover<float>, Mover<double>> mover_;
    std::mutex preparing_;
};

// The kernels of one name, looked up by the first query of each precision and then kept. Not earlier: to look up
// "avx512" is to choose its form.
class PyKernels {
public:
    explicit PyKernels(std::string name) : name_(std::move(name)) {}

    template <class Real>
    const KernelTable<Real>& table() const {
        auto& found = std::get<Found<Real>>(tables_);
        const KernelTable<Real>* table = found.load(std::memory_order_acquire);
        if (table == nullptr) found.store(table = &find_kernels<Real>(name_), std::memory_order_release);
        return *table;
    }
    const std::string& name() const { return name_; }

private:
    template <class Real>
    using Found = std::atomic<const KernelTable<Real>*>;  // to a table that lives as long as the process

    std::string name_;
    mutable std::tuple<Found<float>, Found<double>> tables_ = {nullptr, nullptr};
};

// What queries take: a handle that has looked its kernels up, or a name, which is looked up at each call.
using KernelArg = std::variant<const PyKernels*, std::string>;

// The handle; null if a name is given.
inline const PyKernels* handle_of(const KernelArg& kernel) {
    const auto* handle = std::get_if<const PyKernels*>(&kernel);
    if (!handle) return nullptr;
    expect(*handle != nullptr, "kernel: expected Kernels or a name, got None");
    return *handle;
}

inline const std::string& name_of(const KernelArg& kernel) {
    const PyKernels* handle = handle_of(kernel);
    return handle ? handle->name() : std::get<std::string>(kernel);
}

template <class Real>
const KernelTable<Real>& table_of(const KernelArg& kernel) {
    const PyKernels* handle = handle_of(kernel);
    return handle ? handle->table<Real>() : find_kernels<Real>(std::get<std::string>(kernel));
}

// Calls define(float{}), then define(double{}). Python picks the overload by dtype and tries float32 first.
template <class Define>
void for_each_precision(const Define& define) {
    define(float{});
    define(double{});
}

using PyBvhClass = py::class_<PyBvh>;

// Defined in bindings_queries.cpp: ray queries. In bindings_surface.cpp: points, normals and error bounds of hits, and
// spawned rays. In bindings_closest.cpp: closest points. In bindings_segments.cpp: line of sight. In
// bindings_distant.cpp: rays from far away. In bindings_stored.cpp: stored trees. In bindings_streams.cpp: rays and
// checksums of streams. In bindings_parts.cpp: single meshes that move.
void bind_queries(PyBvhClass& bvh);
void bind_closest(py::module_& m, PyBvhClass& bvh);
void bind_surface(py::module_& m);
void bind_segments(py::module_& m);
void bind_distant(py::module_& m);
void bind_stored(py::module_& m, PyBvhClass& bvh);
void bind_streams(py::module_& m);
void bind_parts(py::module_& m, PyBvhClass& bvh);

// The options of a tree by their names; std::invalid_argument for others. In bindings.cpp.
Accuracy parse_accuracy(const std::string& name);
NodeForm parse_nodes(const std::string& name);
Quality parse_quality(const std::string& name);

}  // namespace wive

template <class T>
struct pybind11::detail::type_caster<wive::GivenArray<T>> {
    static constexpr auto name = handle_type_name<wive::Array<T>>::name;
    template <class>
    using cast_op_type = wive::GivenArray<T>;

    // Never converts: the array must have the dtype and the layout.
    bool load(handle source, bool) {
        if (!wive::Array<T>::check_(source)) return false;
        source_ = source;
        return true;
    }
    operator wive::GivenArray<T>() const { return {reinterpret_borrow<wive::Array<T>>(source_)}; }

private:
    handle source_;  // alive until the call returns
};
