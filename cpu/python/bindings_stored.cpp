// The Python module: trees in files and in shared memory.
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "build/verify.h"
#include "core/checksum.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "python/bindings.h"

namespace wive {
namespace {

constexpr const char* parts[] = {"units", "vertices", "faces"};

template <class Real>
std::unique_ptr<PyBvh> stored_tree(Array<std::uint8_t> units, Array<Real> vertices, Array<std::int32_t> faces,
                                   const std::string& accuracy, const std::string& nodes, const std::string& quality,
                                   std::size_t node_count, std::size_t triangle_count, int depth, const Point& center,
                                   const Point& extent, float far_away, const Bounds& bounds,
                                   const Checksums& checksums, std::string name, py::object source) {
    const BuildOptions options = {parse_accuracy(accuracy), parse_nodes(nodes), 0, max_depth, parse_quality(quality)};
    constexpr Precision precision = precision_of<Real>;
    expect(precision == Precision::float32 || options.accuracy != Accuracy::exact,
           "accuracy: expected 'fast' or 'watertight' for float64");
    const TreeFacts facts = {node_count, triangle_count, options.accuracy, precision, options.nodes,
                             depth,      center,         extent,           far_away,  bounds};
    return std::make_unique<PyBvh>(std::move(vertices), std::move(faces), options, facts,
                                   Stored{std::move(units), checksums, std::move(name), std::move(source)});
}

// What stored_tree takes besides arrays and options.
py::dict facts_of(const PyBvh& self) {
    const TreeFacts& facts = self.unverified().facts();
    py::dict found;
    found["node_count"] = facts.node_count;
    found["triangle_count"] = facts.triangle_count;
    found["depth"] = facts.depth;
    found["center"] = facts.center;
    found["extent"] = facts.extent;
    found["far_away"] = facts.far_away;
    found["bounds"] = facts.bounds;
    return found;
}

}  // namespace

Checksums PyBvh::checksums() const {
    const auto vertices = std::visit([](const auto& array) { return bytes_of(array); }, vertices_);
    const std::span<const std::byte> data[] = {bvh_->units(), vertices, bytes_of(faces_)};
    Checksums found;
    const Released released;
    Threads threads(thread_count(0));
    for (std::size_t i = 0; i < found.size(); ++i) found[i] = checksum(data[i], threads);
    return found;
}

// Several threads may do this at once. There is no lock that a process which forks meanwhile would find taken.
void PyBvh::verify() const {
    if (!stored_) return;
    const Stored& stored = *stored_;
    const ProgressPart uncounted(0, 0);  // of the query that comes first
    const Checksums found = checksums();
    const auto expect_good = [&](bool good, const std::string& fault) {
        if (!good) throw std::invalid_argument(stored.name + ": is damaged (" + fault + ")");
    };
    for (std::size_t i = 0; i < found.size(); ++i)
        expect_good(found[i] == stored.checksums[i], std::string("wrong checksum of its ") + parts[i]);
    std::visit(
        [&]<class Real>(const Array<Real>&) {
            const Mesh<Real> view = mesh<Real>();
            const Released released;
            Threads threads(thread_count(0));
            try {
                verify_tree(*bvh_, view, threads);
            } catch (const std::invalid_argument& fault) {
                expect_good(false, fault.what());
            }
        },
        vertices_);
    is_verified_.store(true, std::memory_order_release);
}

void bind_stored(py::module_& m, PyBvhClass& bvh) {
    for_each_precision([&]<class Real>(Real) {
        m.def("stored_tree", &stored_tree<Real>, array_arg("units"), array_arg("vertices"), array_arg("faces"),
              py::arg("accuracy"), py::arg("nodes"), py::arg("quality"), py::arg("node_count"),
              py::arg("triangle_count"), py::arg("depth"), py::arg("center"), py::arg("extent"), py::arg("far_away"),
              py::arg("bounds"), py::arg("checksums"), py::arg("name"), py::arg("source"));
    });
    bvh.def_property_readonly("facts", &facts_of)
        .def_property_readonly("source", &PyBvh::source)
        .def("checksums", &PyBvh::checksums)
        .def("verify", [](const PyBvh& self) { self.bvh(); });
    m.def(
        "checksum",
        [](const Array<std::uint8_t>& data, unsigned threads) {
            const std::span<const std::byte> bytes = bytes_of(data);
            const Released released;
            Threads own(thread_count(threads));
            return checksum(bytes, own);
        },
        array_arg("data"), py::arg("threads") = 0);
}

}  // namespace wive
