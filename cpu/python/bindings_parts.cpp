// The Python module: one of the meshes of a tree moved in place.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "build/part_mover.h"
#include "core/default_floats.h"
#include "core/parallel.h"
#include "python/bindings.h"

namespace wive {
namespace {

using Offsets = Array<std::int32_t>;

// What holds a scene's tree: the object that traces with it, the tree, and the vertices.
struct Held {
    py::object tracer, bvh, vertices;

    explicit Held(const py::tuple& held) {
        expect(held.size() == 3, "expected (tracer, bvh, vertices)");
        tracer = held[0];
        bvh = held[1];
        vertices = held[2];
    }
};

bool as_few_refer(const py::object& object, const py::object& alike) {
    return Py_REFCNT(object.ptr()) == Py_REFCNT(alike.ptr());
}

// Whether no other array or object shows the memory of `vertices`.
bool owns_data(const py::object& vertices, const py::object& alike) {
    if (!as_few_refer(vertices, alike)) return false;
    const auto array = py::reinterpret_borrow<py::array>(vertices);
    if (array.owndata()) return true;
    PyObject* const base = py::detail::array_proxy(array.ptr())->base;
    return base != nullptr && py::isinstance<py::array>(base) && Py_REFCNT(base) == 1 &&
           py::reinterpret_borrow<py::array>(base).owndata();
}

template <class Real>
Array<Real> copy_of(const Array<Real>& array) {
    const auto size = static_cast<std::size_t>(array.size());
    expect_memory(size * sizeof(Real));
    Array<Real> copy({array.shape(0), array.shape(1)});
    std::copy_n(array.data(), size, copy.mutable_data());
    copy.attr("flags").attr("writeable") = false;
    return copy;
}

// Whether as few refer to what traces and to the tree as to those of a scene that nobody uses.
bool is_unused(const Held& held, const Held& alike) {
    return as_few_refer(held.tracer, alike.tracer) && as_few_refer(held.bvh, alike.bvh);
}

// As check_mesh has it.
template <class Real>
bool are_in_range(std::span<const Real> coordinates) {
    return std::all_of(coordinates.begin(), coordinates.end(),
                       [](Real x) { return std::abs(x) <= max_coordinate<Real>; });
}

// Whether the tree was moved. Holds the interpreter lock throughout, so that no query begins meanwhile.
template <class Real>
bool move_part(const py::tuple& holders, const py::tuple& alike, const Array<Real>& rows, const Offsets& starts,
               std::size_t i, const std::vector<std::string>& forget) {
    const Held held(holders), others(alike);
    if (!is_unused(held, others)) return false;
    PyBvh& bvh = held.bvh.cast<PyBvh&>();
    PartMover<Real>* const mover = bvh.part_mover<Real>();
    if (!mover || !are_in_range(std::span(rows.data(), static_cast<std::size_t>(rows.size())))) return false;
    expect(i + 1 < static_cast<std::size_t>(starts.size()), "i: expected a mesh");
    const auto first = static_cast<std::size_t>(starts.data()[i]),
               last = static_cast<std::size_t>(starts.data()[i + 1]);
    const bool in_place = owns_data(held.vertices, others.vertices);
    Array<Real> vertices = std::get<Array<Real>>(bvh.vertices());
    expect(first <= last && last <= static_cast<std::size_t>(vertices.shape(0)) && rows.ndim() == 2 &&
               static_cast<std::size_t>(rows.shape(0)) == last - first && rows.shape(1) == 3,
           "rows: expected as many as the mesh has vertices");
    if (!in_place) vertices = copy_of(vertices);
    // The array is read-only for Python alone: its memory can be written to.
    Real* const to = const_cast<Real*>(vertices.data()) + 3 * first;
    const std::size_t bytes = sizeof(Real) * 3 * (last - first);
    const std::vector<Real> before(to, to + 3 * (last - first));
    const DefaultFloats floats;
    const Poll uninterrupted(nullptr);  // what this thread's caller raises would leave half of the tree moved
    Threads threads(thread_count(0));
    std::memcpy(to, rows.data(), bytes);
    if (!bvh.move_part<Real>(vertices, *mover, i, threads)) {
        std::memcpy(to, before.data(), bytes);
        return false;
    }
    const auto computed = held.tracer.attr("__dict__").cast<py::dict>();
    for (const std::string& name : forget) computed.attr("pop")(name, py::none());
    computed["vertices"] = bvh.vertices();
    return true;
}

}  // namespace

template <class Real>
void PyBvh::prepare_part(const Offsets& first_faces, std::size_t i) {
    const Bvh& tree = bvh();
    const Mesh<Real> whole = mesh<Real>();
    const std::span<const std::int32_t> offsets(first_faces.data(), static_cast<std::size_t>(first_faces.size()));
    expect(i + 1 < offsets.size() && offsets.front() == 0 && std::is_sorted(offsets.begin(), offsets.end()) &&
               static_cast<std::size_t>(offsets.back()) == whole.face_count,
           "first_faces: expected where the faces of each mesh begin, and a mesh");
    if (!tree.can_change()) return;
    const Released released;
    // Never waits: a process that was forked while another thread prepared would find the lock taken for ever. A mesh
    // that isn't prepared is refitted with all others.
    const std::unique_lock lock(preparing_, std::try_to_lock);
    if (!lock) return;
    Threads threads(thread_count(0));
    if (!part_mover<Real>()) mover_ = std::make_unique<PartMover<Real>>(whole, offsets, threads);
    part_mover<Real>()->prepare(tree, i, threads);
}

template <class Real>
bool PyBvh::move_part(Array<Real> vertices, PartMover<Real>& mover, std::size_t i, Threads& threads) {
    const Mesh<Real> moved = {vertices.data(), static_cast<std::size_t>(vertices.shape(0)), faces_.data(),
                              static_cast<std::size_t>(faces_.shape(0))};
    auto winding = std::make_unique<WindingCache>();
    if (!mover.move(*bvh_, moved, i, threads)) return false;
    vertices_ = std::move(vertices);
    winding_ = std::move(winding);
    return true;
}

void bind_parts(py::module_& m, PyBvhClass& bvh) {
    m.def(
        "is_unused",
        [](const py::tuple& holders, const py::tuple& alike) { return is_unused(Held(holders), Held(alike)); },
        py::arg("holders"), py::arg("alike"));
    for_each_precision([&]<class Real>(Real) {
        m.def("move_part", &move_part<Real>, py::arg("holders"), py::arg("alike"), array_arg("rows"),
              array_arg("starts"), py::arg("i"), py::arg("forget"));
    });
    bvh.def(
        "prepare_part",
        [](PyBvh& self, const Offsets& first_faces, std::size_t i) {
            std::visit([&]<class Real>(const Array<Real>&) { self.prepare_part<Real>(first_faces, i); },
                       self.vertices());
        },
        array_arg("first_faces"), py::arg("i"));
}

}  // namespace wive
