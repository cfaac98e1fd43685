// Rays from far away, brought nearer in double before they are traced in float (wive/_internal/distant.py).
#include <array>
#include <cmath>
#include <limits>

#include "build/far_away.h"
#include "core/interval.h"
#include "python/bindings.h"
#include "python/each_hit.h"

namespace wive {
namespace {

// clang-format off
#include "core/number.inc"
#include "core/double3.inc"
// clang-format on

// What is far away: an origin more than `far` from the centre on some axis.
struct Distance {
    Double3 center;
    double far, most;  // origins with a coordinate beyond `most` stay

    // How far along the ray it comes nearest to the centre, in lengths of its direction; zero if it starts near.
    double step(Double3 origin, Double3 direction) const {
        const double length = direction.abs().max();
        const bool is_ray =
            origin.abs().max() <= most && length > 0 && length < std::numeric_limits<double>::infinity();
        if (!is_ray || !((center - origin).abs().max() > far)) return 0;
        const double along = to_nearest(origin, direction / length) / length;
        return std::isfinite(along) ? along : 0;
    }

    // Where the ray is after `step`, less the length `before`. The step and the sum are rounded to 1e-16 of the way,
    // which may be more than the size of the scene: so the sum is moved along the ray once more.
    Double3 start(Double3 origin, Double3 direction, double step, double before = 0) const {
        const Double3 unit = direction / direction.abs().max(), near = origin + direction * step;
        return near + unit * (to_nearest(near, unit) - before / std::sqrt(Double3::dot(unit, unit)));
    }

private:
    double to_nearest(Double3 origin, Double3 unit) const {
        return Double3::dot(center - origin, unit) / Double3::dot(unit, unit);
    }
};

// Halfway to the next float on the side of `towards`: hits up to there have a t that is rounded to the limit.
double middle(float limit, float towards) { return 0.5 * limit + 0.5 * std::nextafter(limit, towards); }

// Rays in double, as they were given, and in float, as they are traced if they start near.
struct GivenRays {
    const Array<double>&origins, &directions;
    const Array<float>&rounded_origins, &rounded_directions, &tmin, &tmax;

    void check() const {
        expect_shape(origins, 3, "origins: expected shape (n, 3)");
        const py::ssize_t count = origins.shape(0);
        for (const py::ssize_t size : {directions.size(), rounded_origins.size(), rounded_directions.size()})
            expect(size == origins.size(), "rays: expected arrays of one size");
        for (const py::ssize_t size : {tmin.size(), tmax.size()})
            expect(size == 1 || size == count, "limits: expected one value or one per ray");
    }
    bool are_floats(std::size_t i) const {
        bool same = true;
        for (std::size_t k = 3 * i; k < 3 * i + 3; ++k)
            same = same && static_cast<double>(rounded_origins.data()[k]) == origins.data()[k] &&
                   static_cast<double>(rounded_directions.data()[k]) == directions.data()[k];
        return same;
    }
};

template <class Real>
bool may_have_far(const Array<Real>& origins, const std::array<double, 3>& center, double far) {
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    return Distant{center, far}.may_hold(origins.data(), static_cast<std::size_t>(origins.shape(0)));
}

// The rays as a float32 scene traces them: origins (n,3), tmin, tmax and how far each was moved (n,); None if none was.
// `kept`: rays that float holds stay.
py::object bring_near(const Array<double>& origins, const Array<double>& directions,
                      const Array<float>& rounded_origins, const Array<float>& rounded_directions,
                      const Array<float>& tmin, const Array<float>& tmax, const std::array<double, 3>& center,
                      double far, double most, bool kept, unsigned threads) {
    const GivenRays rays = {origins, directions, rounded_origins, rounded_directions, tmin, tmax};
    rays.check();
    const py::ssize_t count = origins.shape(0);
    auto near = make_rows<float>(count);
    auto low = new_array<float>({count}), high = new_array<float>({count});
    auto steps = new_array<double>({count});
    float *near_out = near.mutable_data(), *low_out = low.mutable_data(), *high_out = high.mutable_data();
    double* steps_out = steps.mutable_data();
    const Distance distance = {Double3::load(center.data()), far, most};
    std::atomic<bool> any = false;
    constexpr float infinity = std::numeric_limits<float>::infinity();
    constexpr double most_t = std::numeric_limits<float>::max();
    const auto bring = [&](std::size_t i) {
        const Double3 origin = Double3::load(origins.data() + 3 * i);
        const Double3 direction = Double3::load(directions.data() + 3 * i);
        const float least = tmin.data()[tmin.size() == 1 ? 0 : i], greatest = tmax.data()[tmax.size() == 1 ? 0 : i];
        double step = kept && rays.are_floats(i) ? 0 : distance.step(origin, direction);
        // Hits have a t of about `step`. If that could overflow float, the ray is not moved.
        if (std::abs(step) > most_t / 2) step = 0;
        double start[3];
        distance.start(origin, direction, step).store(start);
        for (std::size_t axis = 0; axis < 3; ++axis)
            near_out[3 * i + axis] = step == 0 ? rounded_origins.data()[3 * i + axis] : static_cast<float>(start[axis]);
        // A ray that misses by its limits keeps them.
        const bool moved = step != 0, shifted = moved && least <= greatest;
        low_out[i] = shifted ? float_below(middle(least, -infinity) - step) : least;
        high_out[i] = shifted ? float_above(middle(greatest, infinity) - step) : greatest;
        steps_out[i] = step;
        return moved;
    };
    for_each_chunk(static_cast<std::size_t>(count), threads, [&](std::size_t begin, std::size_t end) {
        bool some = false;
        for (std::size_t i = begin; i < end; ++i) some |= bring(i);
        if (some) any = true;
    });
    if (!any) return py::none();
    return py::make_tuple(std::move(near), std::move(low), std::move(high), std::move(steps));
}

// For each ray that starts far away and has the centre ahead: the point on it that lies the length `before` in front of
// its point nearest to the centre. For other rays: their origins.
Array<double> nearest_ahead(const Array<double>& origins, const Array<double>& directions,
                            const std::array<double, 3>& center, double far, double most, double before,
                            unsigned threads) {
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    expect(directions.size() == origins.size(), "directions: expected as many as origins");
    auto near = make_rows<double>(origins.shape(0));
    const double *from = origins.data(), *along = directions.data();
    double* out = near.mutable_data();
    const Distance distance = {Double3::load(center.data()), far, most};
    for_each_chunk(static_cast<std::size_t>(origins.shape(0)), threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Double3 origin = Double3::load(from + 3 * i), direction = Double3::load(along + 3 * i);
            const double step = distance.step(origin, direction);
            (step > 0 ? distance.start(origin, direction, step, before) : origin).store(out + 3 * i);
        }
    });
    return near;
}

}  // namespace

void bind_distant(py::module_& m) {
    for_each_precision([&]<class Real>(Real) {
        m.def("may_have_far", &may_have_far<Real>, array_arg("origins"), py::arg("center"), py::arg("far"));
    });
    m.def("bring_near", &bring_near, array_arg("origins"), array_arg("directions"), array_arg("rounded_origins"),
          array_arg("rounded_directions"), array_arg("tmin"), array_arg("tmax"), py::arg("center"), py::arg("far"),
          py::arg("most"), py::arg("kept"), py::arg("threads") = 0);
    m.def("nearest_ahead", &nearest_ahead, array_arg("origins"), array_arg("directions"), py::arg("center"),
          py::arg("far"), py::arg("most"), py::arg("before"), py::arg("threads") = 0);
}

}  // namespace wive
