#include "render/render.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <vector>

#include "core/parallel.h"
#include "core/random.h"
#include "kernels/trace.h"

namespace wive {
namespace {

constexpr float gray_albedo = 0.6f;
constexpr int tile_width = 32;           // pixels of a row that one thread renders
constexpr std::size_t wave_size = 4096;  // about as many paths are in a wavefront
// Lifts a bounce's origin off its surface, as a multiple of the largest coordinate: 64 times the unit roundoff, well
// above the rounding error of the point.
constexpr float surface_offset = 0x1p-18f;

struct Path {
    Vec3 throughput;
    std::uint32_t pixel;  // counted from the tile's first
    std::uint32_t sample;
};

// Sine and cosine on [-pi/4, pi/4] to float's precision, by their Taylor series: the same operations, and so the same
// bits, on every backend.
void sine_cosine(float x, float& sine, float& cosine) {
    const float s = x * x;
    sine = x * (1.0f + s * (-1.0f / 6 + s * (1.0f / 120 + s * (-1.0f / 5040 + s * (1.0f / 362880)))));
    cosine = 1.0f + s * (-0.5f + s * (1.0f / 24 + s * (-1.0f / 720 + s * (1.0f / 40320))));
}

// A cosine-distributed direction about the unit normal n: Shirley and Chiu's concentric disk, projected to the
// hemisphere.
Vec3 cosine_direction(Vec3 n, float random_a, float random_b) {
    constexpr float quarter_pi = 0.785398163f;
    const float a = 2 * random_a - 1, b = 2 * random_b - 1;
    const bool along_a = std::abs(a) > std::abs(b);
    const float radius = along_a ? a : b, other = along_a ? b : a;
    float sine = 0, cosine = 1;
    if (radius != 0) sine_cosine(quarter_pi * (other / radius), sine, cosine);
    const float x = radius * (along_a ? cosine : sine), y = radius * (along_a ? sine : cosine);
    const float z = std::sqrt(std::max(0.0f, 1 - x * x - y * y));
    // Duff et al. 2017, "Building an Orthonormal Basis, Revisited"
    const float sign = std::copysign(1.0f, n.z), p = -1.0f / (sign + n.z), q = n.x * n.y * p;
    const Vec3 tangent = {1 + sign * n.x * n.x * p, sign * q, -sign * n.x}, bitangent = {q, sign + n.y * n.y * p, -n.y};
    return tangent * x + bitangent * y + n * z;
}

// One thread's paths, traced bounce by bounce, so that kernels get batches.
class Wave {
public:
    explicit Wave(const RenderJob& job) : job_(job) {}

    // Renders all samples of pixels [x_begin, x_end) of a row. Returns the number of rays traced.
    std::uint64_t render(int row, int x_begin, int x_end) {
        const auto pixels = static_cast<std::size_t>(x_end - x_begin);
        std::vector<Vec3> sums(pixels, Vec3{0, 0, 0});
        const auto samples_at_once = std::max<std::size_t>(1, wave_size / pixels);
        std::uint64_t rays = 0;
        for (std::size_t first = 0; first < static_cast<std::size_t>(job_.samples); first += samples_at_once) {
            const std::size_t last = std::min(first + samples_at_once, static_cast<std::size_t>(job_.samples));
            start(row, x_begin, pixels, first, last);
            for (int bounce = 0; !paths_.empty(); ++bounce) {
                rays += paths_.size();
                trace();
                shade(row, x_begin, bounce, sums);
            }
        }
        float* out = job_.image + 3 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(job_.width) +
                                       static_cast<std::size_t>(x_begin));
        const float scale = 1.0f / static_cast<float>(job_.samples);
        for (const Vec3& sum : sums) {
            const Vec3 mean = sum * scale;
            *out++ = mean.x;
            *out++ = mean.y;
            *out++ = mean.z;
        }
        return rays;
    }

private:
    std::uint32_t pixel_index(int row, int x_begin, std::uint32_t pixel) const {
        return static_cast<std::uint32_t>(row) * static_cast<std::uint32_t>(job_.width) +
               static_cast<std::uint32_t>(x_begin) + pixel;
    }

    void push_ray(Vec3 origin, Vec3 direction) {
        origins_.insert(origins_.end(), {origin.x, origin.y, origin.z});
        directions_.insert(directions_.end(), {direction.x, direction.y, direction.z});
    }

    void start(int row, int x_begin, std::size_t pixels, std::size_t first_sample, std::size_t last_sample) {
        paths_.clear();
        origins_.clear();
        directions_.clear();
        for (std::uint32_t pixel = 0; pixel < pixels; ++pixel)
            for (std::size_t s = first_sample; s < last_sample; ++s) {
                const auto sample = static_cast<std::uint32_t>(s);
                const auto random = pcg4d(pixel_index(row, x_begin, pixel), sample, 0, job_.seed);
                const float x = static_cast<float>(x_begin) + static_cast<float>(pixel) + to_unit(random[0]);
                const float y = static_cast<float>(row) + to_unit(random[1]);
                const Camera& c = job_.camera;
                const Vec3 toward = c.centre + c.right * (2 * x / static_cast<float>(job_.width) - 1) +
                                    c.up * (1 - 2 * y / static_cast<float>(job_.height));
                paths_.push_back({{1, 1, 1}, pixel, sample});
                push_ray(c.eye, normalize(toward));
            }
    }

    void trace() {
        static constexpr float zero = 0, infinity = std::numeric_limits<float>::infinity();
        t_.resize(paths_.size());
        prim_.resize(paths_.size());
        uv_.resize(2 * paths_.size());
        if (const ForeignTracer& other = job_.tracer; other.function) {
            other.function(other.context, paths_.size(), origins_.data(), directions_.data(), zero, infinity, t_.data(),
                           prim_.data(), uv_.data());
            return;
        }
        HitBatch<float> hits;
        hits.t = t_.data();
        hits.prim = prim_.data();
        hits.uv = uv_.data();
        wive::trace<float>(job_.kernels, job_.kernels.find({QueryKind::closest, job_.accuracy, job_.nodes, false}),
                           job_.bvh, {origins_.data(), directions_.data(), &zero, &infinity, 0, 0}, hits, paths_.size(),
                           1, job_.in_flight);
    }

    // Adds the throughput of paths that missed to their pixels, because the sky's radiance is 1, and bounces the others
    // unless they have reached the bounce limit.
    void shade(int row, int x_begin, int bounce, std::vector<Vec3>& sums) {
        next_origins_.clear();
        next_directions_.clear();
        std::size_t alive = 0;
        for (std::size_t i = 0; i < paths_.size(); ++i) {
            Path path = paths_[i];
            if (static_cast<std::uint32_t>(prim_[i]) >= job_.mesh.face_count) {  // no hit is no_prim
                sums[path.pixel] = sums[path.pixel] + path.throughput;
                continue;
            }
            if (bounce == job_.bounces) continue;
            const auto prim = static_cast<std::size_t>(prim_[i]);
            const float* const corner[3] = {job_.mesh.corner(prim, 0), job_.mesh.corner(prim, 1),
                                            job_.mesh.corner(prim, 2)};
            const Vec3 normal = unit_normal(corner[0], corner[1], corner[2]);
            const Vec3 a = load_vec3(corner[0]), b = load_vec3(corner[1]), c = load_vec3(corner[2]);
            if (job_.albedo == Albedo::normals)
                path.throughput = path.throughput * (normal * 0.5f + Vec3{0.5f, 0.5f, 0.5f});
            else
                path.throughput = path.throughput * gray_albedo;
            const float u = uv_[2 * i], v = uv_[2 * i + 1];
            const Vec3 point = a * (1 - u - v) + b * u + c * v;
            const Vec3 facing = dot(normal, load_vec3(&directions_[3 * i])) > 0 ? normal * -1.0f : normal;
            const auto random = pcg4d(pixel_index(row, x_begin, path.pixel), path.sample,
                                      static_cast<std::uint32_t>(bounce + 1), job_.seed);
            const Vec3 direction = cosine_direction(facing, to_unit(random[0]), to_unit(random[1]));
            const Vec3 origin =
                point + facing * (surface_offset * std::max(largest_component(point), largest_component(a)));
            paths_[alive++] = path;
            next_origins_.insert(next_origins_.end(), {origin.x, origin.y, origin.z});
            next_directions_.insert(next_directions_.end(), {direction.x, direction.y, direction.z});
        }
        paths_.resize(alive);
        origins_.swap(next_origins_);
        directions_.swap(next_directions_);
    }

    const RenderJob& job_;
    std::vector<Path> paths_;
    std::vector<float> origins_, directions_, next_origins_, next_directions_, t_, uv_;
    std::vector<std::int32_t> prim_;
};

}  // namespace

std::uint64_t render_rows(const RenderJob& job, int row_begin, int row_end, unsigned threads) {
    const int tiles = (job.width + tile_width - 1) / tile_width;
    std::atomic<std::uint64_t> rays{0};
    parallel_for(static_cast<std::size_t>(tiles) * static_cast<std::size_t>(row_end - row_begin), threads,
                 [&](std::size_t i) {
                     const int row = row_begin + static_cast<int>(i) / tiles;
                     const int x = static_cast<int>(i) % tiles * tile_width;
                     rays += Wave(job).render(row, x, std::min(job.width, x + tile_width));
                 });
    return rays;
}

}  // namespace wive
