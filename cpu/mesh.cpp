#include "mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "exact.h"
#include "layout.h"
#include "parallel.h"

namespace wive {
namespace {

constexpr std::size_t chunk_size = 1 << 14;

// The lowest index in [0, count) for which is_bad holds, or count.
template <class IsBad>
std::size_t first_bad(std::size_t count, unsigned threads, const IsBad& is_bad) {
    std::atomic<std::size_t> first{count};
    parallel_chunks(count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
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

// Whether the three corners lie on one line, decided exactly: they do where all three projections have area zero.
bool has_no_area(const float* a, const float* b, const float* c) {
    // Filter: a component of the cross product in double, larger than its rounding error, settles it.
    constexpr double error = 8 * std::numeric_limits<double>::epsilon();
    double u[3], v[3];
    for (int k = 0; k < 3; ++k) {
        u[k] = static_cast<double>(b[k]) - a[k];
        v[k] = static_cast<double>(c[k]) - a[k];
    }
    for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double left = u[i] * v[j], right = u[j] * v[i];
        if (std::abs(left - right) > error * (std::abs(left) + std::abs(right))) return false;
    }
    for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const float p[2] = {a[i], a[j]}, q[2] = {b[i], b[j]}, r[2] = {c[i], c[j]};
        if (orientation(p, q, r) != 0) return false;
    }
    return true;
}

}  // namespace

void check_mesh(const Mesh& mesh, unsigned threads) {
    if (mesh.vertex_count > std::numeric_limits<std::int32_t>::max())
        throw std::invalid_argument("vertices: expected at most 2147483647, split the mesh into several scenes");
    const auto bad_vertex = [&](std::size_t i) {
        for (int k = 0; k < 3; ++k)
            if (!(std::abs(mesh.vertices[3 * i + static_cast<std::size_t>(k)]) <= max_coordinate)) return true;
        return false;
    };
    if (const std::size_t i = first_bad(mesh.vertex_count, threads, bad_vertex); i < mesh.vertex_count) {
        const float* v = mesh.vertices + 3 * i;
        std::ostringstream text;
        text << "vertices[" << i << "] = (" << v[0] << ", " << v[1] << ", " << v[2]
             << "): expected finite coordinates of at most 1e18 in magnitude; remove or repair this vertex";
        throw std::invalid_argument(text.str());
    }
    const auto bad_face = [&](std::size_t i) {
        for (std::size_t k = 0; k < 3; ++k)
            if (static_cast<std::size_t>(static_cast<std::uint32_t>(mesh.faces[3 * i + k])) >= mesh.vertex_count)
                return true;
        return false;
    };
    if (const std::size_t i = first_bad(mesh.face_count, threads, bad_face); i < mesh.face_count) {
        const std::int32_t* f = mesh.faces + 3 * i;
        std::ostringstream text;
        text << "faces[" << i << "] = (" << f[0] << ", " << f[1] << ", " << f[2] << "): expected indices in 0.."
             << static_cast<long long>(mesh.vertex_count) - 1 << ", there are " << mesh.vertex_count << " vertices";
        throw std::invalid_argument(text.str());
    }
}

LargeArray<PrimRef> make_prim_refs(const Mesh& mesh, unsigned threads, std::size_t& count) {
    LargeArray<PrimRef> refs(mesh.face_count);
    const std::size_t chunks = (mesh.face_count + chunk_size - 1) / chunk_size;
    std::vector<std::size_t> kept(chunks);
    parallel_chunks(mesh.face_count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        std::size_t to = begin;
        for (std::size_t face = begin; face < end; ++face) {
            const float *a = mesh.corner(face, 0), *b = mesh.corner(face, 1), *c = mesh.corner(face, 2);
            if (has_no_area(a, b, c)) continue;
            Box box;
            for (const float* v : {a, b, c}) box.grow(Float4v{v[0], v[1], v[2], 0.0f});
            box.lo[3] = std::bit_cast<float>(static_cast<std::uint32_t>(face));
            refs[to++] = {box.lo, box.hi};
        }
        kept[begin / chunk_size] = to - begin;
    });
    count = 0;  // close the gaps that left-out triangles made; usually there is none and nothing moves
    for (std::size_t i = 0; i < chunks; ++i) {
        const std::size_t from = i * chunk_size;
        if (count != from) std::copy(refs.data() + from, refs.data() + from + kept[i], refs.data() + count);
        count += kept[i];
    }
    return refs;
}

}  // namespace wive
