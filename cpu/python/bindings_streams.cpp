// The Python module: rays and checksums of streams.
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "core/crc32.h"
#include "core/running_checksum.h"
#include "python/bindings.h"

#if __has_include(<unistd.h>)
#include <unistd.h>
#endif

namespace wive {
namespace {

// Arrays of rays that rows of numbers are split into: origin, direction and, of eight numbers, tmin and tmax.
template <class Real>
class SplitRays {
public:
    SplitRays(Array<Real>& origins, Array<Real>& directions, std::optional<Array<Real>>& tmin,
              std::optional<Array<Real>>& tmax)
        : count_(origins.shape(0)), origins_(origins.mutable_data()), directions_(directions.mutable_data()) {
        expect_shape(origins, 3, "origins: expected shape (n, 3)");
        expect_shape(directions, 3, "directions: expected shape (n, 3)");
        expect(directions.shape(0) == count_, "directions: expected as many as origins");
        expect(tmin.has_value() == tmax.has_value(), "tmax: expected with tmin");
        for (std::optional<Array<Real>>* limit : {&tmin, &tmax})
            if (*limit)
                expect((*limit)->ndim() == 1 && (*limit)->shape(0) == count_, "tmin, tmax: expected shape (n,)");
        if (tmin) tmin_ = tmin->mutable_data();
        if (tmax) tmax_ = tmax->mutable_data();
    }

    py::ssize_t count() const { return count_; }
    py::ssize_t columns() const { return tmin_ ? 8 : 6; }

    // Rays `first` and on, so many.
    void write(py::ssize_t first, py::ssize_t count, const Real* row, py::ssize_t columns) const {
        Real *origin = origins_ + 3 * first, *direction = directions_ + 3 * first;
        for (py::ssize_t i = first; i < first + count; ++i, row += columns, origin += 3, direction += 3) {
            // Not std::copy_n, for which GCC calls memmove: that takes three times as long.
            std::memcpy(origin, row, sizeof(Real[3]));
            std::memcpy(direction, row + 3, sizeof(Real[3]));
            if (tmin_) tmin_[i] = row[6], tmax_[i] = row[7];
        }
    }

private:
    py::ssize_t count_;
    Real *origins_, *directions_, *tmin_ = nullptr, *tmax_ = nullptr;
};

template <class Real>
void split_rays(const Array<Real>& table, Array<Real>& origins, Array<Real>& directions) {
    std::optional<Array<Real>> none;
    const SplitRays<Real> rays(origins, directions, none, none);
    expect(table.ndim() == 2 && table.shape(1) >= 6, "table: expected shape (n, 6) or more columns");
    expect(rays.count() == table.shape(0), "table: expected as many rows as origins");
    const Real* row = table.data();
    const py::ssize_t columns = table.shape(1);
    const py::gil_scoped_release released;
    rays.write(0, rays.count(), row, columns);
}

#if __has_include(<unistd.h>)

// Fills the buffer with the file's bytes from a place on; returns how many there were, or -1 and errno.
std::ptrdiff_t read_at(int file, std::span<std::byte> buffer, std::int64_t place) {
    std::size_t done = 0;
    while (done < buffer.size()) {
        const auto count = ::pread(file, buffer.data() + done, buffer.size() - done,
                                   static_cast<off_t>(place + static_cast<std::int64_t>(done)));
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return -1;
        if (count == 0) break;
        done += static_cast<std::size_t>(count);
    }
    return static_cast<std::ptrdiff_t>(done);
}

// Reads a table of rays from a place of a file on, in steps that stay in a cache; returns how many bytes there were.
template <class Real>
std::int64_t read_rays(int file, std::int64_t place, Array<Real> origins, Array<Real> directions,
                       std::optional<Array<Real>> tmin, std::optional<Array<Real>> tmax, RunningChecksum* sum) {
    const SplitRays<Real> rays(origins, directions, tmin, tmax);
    const py::ssize_t columns = rays.columns(), row = columns * static_cast<py::ssize_t>(sizeof(Real));
    const py::ssize_t step = static_cast<py::ssize_t>(RunningChecksum::block_bytes) / row;
    std::int64_t total = 0;
    int failed = 0;
    {
        const py::gil_scoped_release released;
        std::vector<Real> table(static_cast<std::size_t>(std::min(step, rays.count()) * columns));
        for (py::ssize_t first = 0; first < rays.count(); first += step) {
            const py::ssize_t count = std::min(step, rays.count() - first);
            const auto bytes =
                std::as_writable_bytes(std::span(table).first(static_cast<std::size_t>(count * columns)));
            const std::ptrdiff_t found = read_at(file, bytes, place + total);
            if (found < 0) failed = errno;
            if (found > 0) total += found;
            if (found != static_cast<std::ptrdiff_t>(bytes.size())) break;
            if (sum) sum->add(bytes);
            rays.write(first, count, table.data(), columns);
        }
    }
    if (failed) {
        errno = failed;
        PyErr_SetFromErrno(PyExc_OSError);
        throw py::error_already_set();
    }
    return total;
}

#endif

}  // namespace

void bind_streams(py::module_& m) {
    m.def(
        "crc32",
        [](const Array<std::uint8_t>& data, std::uint32_t before) {
            const auto bytes = bytes_of(data);
            const py::gil_scoped_release released;
            return crc32(bytes, before);
        },
        array_arg("data"), py::arg("before") = 0);
    py::class_<RunningChecksum>(m, "RunningChecksum")
        .def(py::init<>())
        .def_readonly_static("block_bytes", &RunningChecksum::block_bytes)
        .def(
            "add",
            [](RunningChecksum& self, const Array<std::uint8_t>& data) {
                const auto bytes = bytes_of(data);
                const py::gil_scoped_release released;
                self.add(bytes);
            },
            array_arg("data"))
        .def_property_readonly("both", &RunningChecksum::both);
    for_each_precision([&]<class Real>(Real) {
        m.def("split_rays", &split_rays<Real>, array_arg("table"), array_arg("origins"), array_arg("directions"));
#if __has_include(<unistd.h>)
        m.def("read_rays", &read_rays<Real>, py::arg("file"), py::arg("place"), array_arg("origins"),
              array_arg("directions"), array_arg("tmin"), array_arg("tmax"), py::arg("checksum"));
#endif
    });
}

}  // namespace wive
