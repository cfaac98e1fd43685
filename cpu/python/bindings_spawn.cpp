// Origins of spawned rays, four at a time.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

#include "core/lanes4.h"
#include "core/processor.h"
#include "python/bindings.h"
#include "python/each_hit.h"

namespace wive {
namespace {

// clang-format off
namespace one {
#include "core/number.inc"
#include "core/double3.inc"
#include "core/spawn.inc"
#include "core/spawn_store.inc"
}  // namespace one
namespace four {
using Number = Lanes4;
using Numbers = Lanes4;
#include "core/double3.inc"
#include "core/spawn.inc"
}  // namespace four
// clang-format on

using four::SpawnOrigin;

static_assert(SpawnOrigin::fast == static_cast<int>(Accuracy::fast) &&
              SpawnOrigin::watertight == static_cast<int>(Accuracy::watertight) &&
              SpawnOrigin::exact == static_cast<int>(Accuracy::exact));

// The hits of a call, and where their origins go.
template <class Real>
struct SpawnCall {
    const HitTriangles<Real>& triangles;
    const Real *uv, *directions;
    Real* origins;
    SpawnOrigin spawn;

    // Hits [begin, end). Blocks are gathered, moved in lanes, rounded and stored.
    [[gnu::always_inline]] inline void run(std::size_t begin, std::size_t end) const {
        constexpr std::size_t block = 32, width = Lanes4::width;
        alignas(32) double corner[3][3][block] = {}, u[block] = {}, v[block] = {}, direction[3][block] = {};
        alignas(32) double point[3][block], normal[3][block];
        for (; begin < end; begin += block) {
            const std::size_t count = std::min(block, end - begin);
            for (std::size_t k = 0; k < count; ++k) gather(begin + k, k, corner, u, v, direction);
            for (std::size_t k = 0; k < count; k += width) {
                Lanes4 corners[3][3];
                for (int i = 0; i < 3; ++i)
                    for (int axis = 0; axis < 3; ++axis) corners[i][axis] = Lanes4::load(&corner[i][axis][k]);
                const four::Double3 along = {Lanes4::load(&direction[0][k]), Lanes4::load(&direction[1][k]),
                                             Lanes4::load(&direction[2][k])};
                const SpawnOrigin::Moved moved = spawn.move(corners, Lanes4::load(u + k), Lanes4::load(v + k), along);
                const Lanes4 to[6] = {moved.point.x,  moved.point.y,  moved.point.z,
                                      moved.normal.x, moved.normal.y, moved.normal.z};
                for (int axis = 0; axis < 3; ++axis) {
                    to[axis].store(&point[axis][k]);
                    to[axis + 3].store(&normal[axis][k]);
                }
            }
            Real* out = origins + 3 * begin;
            for (std::size_t k = 0; k < count; ++k)
                for (int axis = 0; axis < 3; ++axis)
                    *out++ = static_cast<Real>(
                        one::SpawnStore::leave(std::is_same_v<Real, float>, point[axis][k], normal[axis][k]));
        }
    }

    // Hit i goes to place k of the block. Without a triangle its origin is NaN, by way of u.
    template <std::size_t block>
    [[gnu::always_inline]] inline void gather(std::size_t i, std::size_t k, double (&corner)[3][3][block],
                                              double (&u)[block], double (&v)[block],
                                              double (&direction)[3][block]) const {
        const bool known = triangles.load(i, [&](std::size_t c, std::size_t axis, Real x) { corner[c][axis][k] = x; });
        u[k] = known ? uv[2 * i] : std::numeric_limits<double>::quiet_NaN();
        v[k] = uv[2 * i + 1];
        one::Double3 along = {directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]};
        if constexpr (std::is_same_v<Real, double>) along = one::SpawnStore::scaled(along);
        direction[0][k] = along.x;
        direction[1][k] = along.y;
        direction[2][k] = along.z;
    }
};

// Both are SpawnCall::run with everything inlined, for processors with AVX2 and for all.
#if defined(__x86_64__)
template <class Real>
[[gnu::flatten, gnu::noinline, gnu::target("avx2")]] void run_avx2(const SpawnCall<Real>& call, std::size_t begin,
                                                                   std::size_t end) {
    call.run(begin, end);
}
#endif
template <class Real>
[[gnu::flatten, gnu::noinline]] void run_plain(const SpawnCall<Real>& call, std::size_t begin, std::size_t end) {
    call.run(begin, end);
}

// accuracy: as SpawnOrigin numbers them; constants: the members of SpawnOrigin from point_error on.
template <class Real>
py::array_t<Real> spawn_origins(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                                const Array<std::int32_t>& prim, const Array<Real>& uv, const Array<Real>& directions,
                                int accuracy, const std::array<double, 8>& constants) {
    expect_rows(uv, 2, prim, "uv: expected shape (n, 2), n as prim has");
    expect_rows(directions, 3, prim, "directions: expected shape (n, 3), n as prim has");
    const HitTriangles<Real> triangles(vertices, faces, prim);
    const auto [point, normal, corner_error, weights_error, fast, step, least, margin] = constants;
    const SpawnOrigin spawn = {
        accuracy, std::is_same_v<Real, float>, point, normal, corner_error, weights_error, fast, step, least, margin};
    auto answer = make_rows<Real>(prim.size());
    const SpawnCall<Real> call = {triangles, uv.data(), directions.data(), answer.mutable_data(), spawn};
    for_each_chunk(triangles.size(), 0, [&](std::size_t begin, std::size_t end) {
#if defined(__x86_64__)
        if (has_avx2()) return run_avx2(call, begin, end);
#endif
        run_plain(call, begin, end);
    });
    return answer;
}

}  // namespace

void bind_spawn(py::module_& m) {
    for_each_precision([&]<class Real>(Real) {
        m.def("spawn_origins", &spawn_origins<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"), array_arg("directions"), py::arg("accuracy"), py::arg("constants"));
    });
}

}  // namespace wive
