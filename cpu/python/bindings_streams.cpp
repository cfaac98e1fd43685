// The Python module: rays and checksums of streams.
#include <cstdint>
#include <cstring>
#include <span>

#include "core/crc32.h"
#include "python/bindings.h"

namespace wive {
namespace {

template <class Real>
void split_rays(const Array<Real>& table, Array<Real>& origins, Array<Real>& directions) {
    expect(table.ndim() == 2 && table.shape(1) >= 6, "table: expected shape (n, 6) or more columns");
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    expect_shape(directions, 3, "directions: expected shape (n, 3)");
    const py::ssize_t count = table.shape(0), columns = table.shape(1);
    expect(origins.shape(0) == count && directions.shape(0) == count, "table: expected as many rows as origins");
    const Real* row = table.data();
    Real *origin = origins.mutable_data(), *direction = directions.mutable_data();
    const py::gil_scoped_release released;
    for (py::ssize_t i = 0; i < count; ++i, row += columns, origin += 3, direction += 3) {
        // Not std::copy_n, for which GCC calls memmove: that takes three times as long.
        std::memcpy(origin, row, sizeof(Real[3]));
        std::memcpy(direction, row + 3, sizeof(Real[3]));
    }
}

}  // namespace

void bind_streams(py::module_& m) {
    m.def(
        "crc32",
        [](const Array<std::uint8_t>& data, std::uint32_t before) {
            const auto bytes = std::as_bytes(std::span(data.data(), static_cast<std::size_t>(data.size())));
            const py::gil_scoped_release released;
            return crc32(bytes, before);
        },
        array_arg("data"), py::arg("before") = 0);
    for_each_precision([&]<class Real>(Real) {
        m.def("split_rays", &split_rays<Real>, array_arg("table"), array_arg("origins"), array_arg("directions"));
    });
}

}  // namespace wive
