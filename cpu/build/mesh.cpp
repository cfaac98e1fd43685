#include "build/mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "build/exact.h"
#include "core/layout.h"
#include "core/parallel.h"
#include "core/planes.h"
#include "core/progress.h"
#include "core/vec3.h"

namespace wive {
namespace {

constexpr std::size_t chunk_size = 1 << 14;

// The lowest index in [0, count) for which is_bad holds, or count. has_bad(begin, end) tells if a chunk has any; it is
// faster per index.
template <class HasBad, class IsBad>
std::size_t first_bad(std::size_t count, Threads& threads, const HasBad& has_bad, const IsBad& is_bad) {
    std::atomic<std::size_t> first{count};
    parallel_chunks(count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        if (!has_bad(begin, end)) return;
        for (std::size_t i = begin; i < end; ++i) {
            if (!is_bad(i)) continue;
            std::size_t seen = first.load();
            while (i < seen && !first.compare_exchange_weak(seen, i)) {
            }
            return;
        }
    });
    return first.load();
}

// Whether a triangle has an area, decided exactly. It has none if and only if its projections onto the three coordinate
// planes have none.
template <class Real>
bool has_area(const Real* a, const Real* b, const Real* c) {
    for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const Real p[2] = {a[i], a[j]}, q[2] = {b[i], b[j]}, r[2] = {c[i], c[j]};
        if (orientation(p, q, r) != 0) return true;
    }
    return false;
}

Float4v yzx(Float4v x) { return __builtin_shufflevector(x, x, 1, 2, 0, 3); }

float projected_area(Float4v a, Float4v b, Float4v c) {
    const Float4v u = b - a, v = c - a, areas = magnitude(u * yzx(v) - yzx(u) * v);
    return areas[0] + areas[1] + areas[2];
}

// A filter before has_area, which it spares most triangles: true if some component of the cross product is larger than
// its rounding error. Differences, products and their sum are each off by a unit roundoff u, which makes 4u of both
// products' sizes. The bound is twice as large, plus the error of underflow.
bool surely_has_area(Float4v a, Float4v b, Float4v c) {
    constexpr float error = 4 * std::numeric_limits<float>::epsilon(),
                    underflow = 4 * std::numeric_limits<float>::min();
    const Float4v u = b - a, v = c - a;
    const Float4v left = u * yzx(v), right = yzx(u) * v;
    const Float4v cross = left - right;
    const Int4v sure = magnitude(cross) > error * (magnitude(left) + magnitude(right)) + underflow;
    return (sure[0] | sure[1] | sure[2]) != 0;
}

template <class Real>
bool surely_has_area(const Real* a, const Real* b, const Real* c) {
    constexpr double error = 4 * std::numeric_limits<double>::epsilon(),
                     underflow = 4 * std::numeric_limits<double>::min();
    double u[3], v[3];
    for (int k = 0; k < 3; ++k) {
        const double origin = a[k];
        u[k] = b[k] - origin;
        v[k] = c[k] - origin;
    }
    bool sure = false;
    for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double left = u[i] * v[j], right = u[j] * v[i];
        sure |= std::abs(left - right) > error * (std::abs(left) + std::abs(right)) + underflow;
    }
    return sure;
}

float projected_area(const double* a, const double* b, const double* c) {
    const auto [x, y, z] = triangle_normal(a, b, c);
    return static_cast<float>(std::abs(x) + std::abs(y) + std::abs(z));
}

// Which vertices are in a face. Any number may stand in the others.
template <class Real>
std::vector<bool> used_vertices(const Mesh<Real>& mesh) {
    std::vector<bool> used(mesh.vertex_count);
    for (std::size_t i = 0; i < 3 * mesh.face_count; ++i) {
        const auto index = static_cast<std::uint32_t>(__atomic_load_n(mesh.faces + i, __ATOMIC_RELAXED));
        if (index < mesh.vertex_count) used[index] = true;
    }
    return used;
}

bool has_area(Float4v a, Float4v b, Float4v c) {
    alignas(16) float corners[3][4];
    std::memcpy(corners[0], &a, sizeof a);
    std::memcpy(corners[1], &b, sizeof b);
    std::memcpy(corners[2], &c, sizeof c);
    return has_area(corners[0], corners[1], corners[2]);
}

}  // namespace

MeshCopy::MeshCopy(const Mesh<float>& mesh, Threads& threads)
    : vertices_(3 * mesh.vertex_count), faces_(3 * mesh.face_count) {
    const ProgressPart uncounted(0, 0);  // of building, of which it is little
    const auto copy = [&threads](const auto* from, auto& to) {
        parallel_chunks_scattered(to.size(), 3 * chunk_size, threads, [&](std::size_t begin, std::size_t end) {
            std::copy(from + begin, from + end, to.data() + begin);
        });
    };
    copy(mesh.vertices, vertices_);
    copy(mesh.faces, faces_);
}

template <class Real>
void check_mesh(const Mesh<Real>& mesh, Threads& threads) {
    if (mesh.vertex_count > std::numeric_limits<std::int32_t>::max())
        throw std::invalid_argument("vertices must be at most 2147483647 in one scene, got " +
                                    std::to_string(mesh.vertex_count) + ": split the mesh into several scenes");
    // Branch-free, so that the compiler vectorises it. The bits of magnitudes compare as the magnitudes do; those of
    // infinities and NaNs are above all others.
    const auto bad_vertices = [&](std::size_t begin, std::size_t end) {
        using Bits = std::conditional_t<sizeof(Real) == sizeof(float), std::int32_t, std::int64_t>;
        constexpr Bits largest = std::bit_cast<Bits>(max_coordinate<Real>),
                       magnitude = std::numeric_limits<Bits>::max();
        Bits bad = 0;
        for (std::size_t i = 3 * begin; i < 3 * end; ++i)
            bad |= largest - (std::bit_cast<Bits>(mesh.vertices[i]) & magnitude);
        return bad < 0;
    };
    const auto bad_vertex = [&](std::size_t i) { return bad_vertices(i, i + 1); };
    std::size_t i = first_bad(mesh.vertex_count, threads, bad_vertices, bad_vertex);
    if (i < mesh.vertex_count) {
        const std::vector<bool> used = used_vertices(mesh);
        while (i < mesh.vertex_count && !(used[i] && bad_vertex(i))) ++i;
    }
    if (i < mesh.vertex_count) {
        const Real* v = mesh.vertices + 3 * i;
        std::ostringstream text;
        text << "vertices[" << i << "] = (" << v[0] << ", " << v[1] << ", " << v[2]
             << "): expected finite coordinates of at most 1e18 in magnitude; remove or repair this vertex";
        throw std::invalid_argument(text.str());
    }
    const auto bad_faces = [&](std::size_t begin, std::size_t end) {
        const std::uint32_t last = static_cast<std::uint32_t>(mesh.vertex_count) - 1;
        std::uint32_t bad = mesh.vertex_count == 0 ? ~0u : 0;
        for (std::size_t i = 3 * begin; i < 3 * end; ++i) {
            const std::uint32_t index = static_cast<std::uint32_t>(mesh.faces[i]);
            bad |= index | (last - index);
        }
        return static_cast<std::int32_t>(bad) < 0;
    };
    const auto bad_face = [&](std::size_t i) { return bad_faces(i, i + 1); };
    if (const std::size_t face = first_bad(mesh.face_count, threads, bad_faces, bad_face); face < mesh.face_count) {
        const std::int32_t* f = mesh.faces + 3 * face;
        std::ostringstream text;
        text << "faces must index the " << mesh.vertex_count << " vertices from 0, got [" << f[0] << ", " << f[1]
             << ", " << f[2] << "] in face " << face;
        throw std::invalid_argument(text.str());
    }
}

template void check_mesh(const Mesh<float>&, Threads&);
template void check_mesh(const Mesh<double>&, Threads&);

std::invalid_argument too_many_triangles(std::size_t count) {
    return std::invalid_argument("faces must be fewer in one scene, whose tree can have 8 GiB, got " +
                                 std::to_string(count) + " triangles: split the mesh into several scenes");
}

bool box_triangle(const Mesh<float>& mesh, const Point&, std::size_t face, Box& box) {
    const Float4v a = load_corner(mesh, face, 0), b = load_corner(mesh, face, 1), c = load_corner(mesh, face, 2);
    box = {minimum(minimum(a, b), c), maximum(maximum(a, b), c)};
    box.hi[3] = projected_area(a, b, c);
    return are_in_range(a, b, c) && (surely_has_area(a, b, c) || has_area(a, b, c));
}

bool box_triangle(const Mesh<double>& mesh, const Point& center, std::size_t face, Box& box) {
    double corners[3][3];
    if (!mesh.load_corners(face, corners)) return false;
    const auto& [a, b, c] = corners;
    box.lo[3] = 0;
    box.hi[3] = projected_area(a, b, c);
    for (int axis = 0; axis < 3; ++axis) {
        const float origin = center[static_cast<std::size_t>(axis)];
        box.lo[axis] = plane_below(std::min({a[axis], b[axis], c[axis]}), origin);
        box.hi[axis] = plane_above(std::max({a[axis], b[axis], c[axis]}), origin);
    }
    return surely_has_area(a, b, c) || has_area(a, b, c);
}

template <class Real>
Bounds find_bounds(const Mesh<Real>& mesh, Threads& threads) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr Bounds none = {{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}}};
    std::vector<Bounds> parts((mesh.face_count + chunk_size - 1) / chunk_size, none);
    parallel_chunks(mesh.face_count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        Bounds part = none;
        for (std::size_t face = begin; face < end; ++face) {
            Real corners[3][3];
            if (!mesh.load_corners(face, corners)) continue;
            const auto& [a, b, c] = corners;
            if (!surely_has_area(a, b, c) && !has_area(a, b, c)) continue;
            for (const auto& corner : corners) grow(part, corner, corner);
        }
        parts[begin / chunk_size] = part;
    });
    Bounds all = none;
    for (const Bounds& part : parts) grow(all, part[0], part[1]);
    return all;
}

template Bounds find_bounds(const Mesh<float>&, Threads&);
template Bounds find_bounds(const Mesh<double>&, Threads&);

template <class Real>
PrimRefs make_prim_refs(const Mesh<Real>& mesh, const Point& center, Threads& threads) {
    PrimRefs all;
    all.refs = LargeArray<PrimRef>(mesh.face_count);
    const std::size_t chunks = (mesh.face_count + chunk_size - 1) / chunk_size;
    struct Part {
        std::size_t count = 0;
        Box box, centroids;
    };
    std::vector<Part> parts(chunks);
    parallel_chunks_scattered(mesh.face_count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        PrimRef* to = all.refs.data() + begin;
        Part part;
        for (std::size_t face = begin; face < end; ++face) {
            Box box;
            if (!box_triangle(mesh, center, face, box)) continue;
            part.box.grow(box);
            part.centroids.grow(box.lo + box.hi);
            PrimRef ref = {box.lo, box.hi};
            ref.lo[3] = std::bit_cast<float>(static_cast<std::uint32_t>(face));
            *to++ = ref;
        }
        part.count = static_cast<std::size_t>(to - (all.refs.data() + begin));
        parts[begin / chunk_size] = part;
    });
    // Close the gaps of triangles without area. Usually there is none and nothing moves.
    std::size_t count = 0;
    for (std::size_t i = 0; i < chunks; ++i) {
        const PrimRef* from = all.refs.data() + i * chunk_size;
        if (count != i * chunk_size) std::copy(from, from + parts[i].count, all.refs.data() + count);
        count += parts[i].count;
        all.box.grow(parts[i].box);
        all.centroids.grow(parts[i].centroids);
    }
    all.count = static_cast<std::uint32_t>(count);
    return all;
}

template PrimRefs make_prim_refs(const Mesh<float>&, const Point&, Threads&);
template PrimRefs make_prim_refs(const Mesh<double>&, const Point&, Threads&);

}  // namespace wive
