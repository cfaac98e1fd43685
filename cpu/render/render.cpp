#include "render/render.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>
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
    std::uint32_t slot;  // of its light
};

// A ray towards the sun, and what it adds to its path's light if nothing is in the way.
struct SunRay {
    Vec3 light;
    std::uint32_t slot;
};

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
                trace(origins_, directions_, paths_.size());
                shade(row, x_begin, bounce);
                rays += sun_rays_.size();
                add_sun();
            }
            for (std::size_t slot = 0; slot < light_.size(); ++slot) {
                Vec3& sum = sums[slot / (last - first)];
                sum = sum + light_[slot];
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

    static void push(std::vector<float>& vectors, Vec3 v) { vectors.insert(vectors.end(), {v.x, v.y, v.z}); }

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
                paths_.push_back({{1, 1, 1}, pixel, sample, static_cast<std::uint32_t>(paths_.size())});
                push(origins_, c.eye);
                push(directions_, normalize(toward));
            }
        light_.assign(paths_.size(), Vec3{0, 0, 0});
    }

    // The closest hits of `count` rays: t_, prim_ and uv_.
    void trace(const std::vector<float>& origins, const std::vector<float>& directions, std::size_t count) {
        t_.resize(count);
        prim_.resize(count);
        uv_.resize(2 * count);
        if (const ForeignTracer& other = job_.tracer; other.function) {
            other.function(other.context, count, origins.data(), directions.data(), zero, infinity, t_.data(),
                           prim_.data(), uv_.data());
            return;
        }
        HitBatch<float> hits;
        hits.t = t_.data();
        hits.prim = prim_.data();
        hits.uv = uv_.data();
        run(QueryKind::closest, origins, directions, hits, count);
    }

    void run(QueryKind query, const std::vector<float>& origins, const std::vector<float>& directions,
             const HitBatch<float>& hits, std::size_t count) {
        wive::trace<float>(job_.kernels, job_.kernels.find({query, job_.accuracy, job_.nodes, false}), job_.bvh,
                           {origins.data(), directions.data(), &zero, &infinity, 0, 0}, hits, count, 1, job_.in_flight);
    }

    // No hit is no_prim.
    bool has_hit(std::size_t i) const { return static_cast<std::uint32_t>(prim_[i]) < job_.mesh.face_count; }

    // Adds the sky's light to paths that missed, and bounces the others unless they have reached the bounce limit.
    // Those that bounce may have a ray towards the sun.
    void shade(int row, int x_begin, int bounce) {
        next_origins_.clear();
        next_directions_.clear();
        sun_rays_.clear();
        sun_origins_.clear();
        sun_directions_.clear();
        const bool has_sun = job_.light.has_sun();
        std::size_t alive = 0;
        for (std::size_t i = 0; i < paths_.size(); ++i) {
            Path path = paths_[i];
            const Vec3 incoming = load_vec3(&directions_[3 * i]);
            if (!has_hit(i)) {
                light_[path.slot] = light_[path.slot] + path.throughput * job_.light.sky(incoming);
                continue;
            }
            if (bounce == job_.bounces) continue;
            const auto prim = static_cast<std::size_t>(prim_[i]);
            const std::size_t vertex[3] = {job_.mesh.vertex(prim, 0), job_.mesh.vertex(prim, 1),
                                           job_.mesh.vertex(prim, 2)};
            const float* const corner[3] = {job_.mesh.vertices + 3 * vertex[0], job_.mesh.vertices + 3 * vertex[1],
                                            job_.mesh.vertices + 3 * vertex[2]};
            const Vec3 normal = unit_normal(corner[0], corner[1], corner[2]);
            const float u = uv_[2 * i], v = uv_[2 * i + 1];
            const auto weighted = [&](Vec3 a, Vec3 b, Vec3 c) { return a * (1 - u - v) + b * u + c * v; };
            const auto colour = [&](std::size_t index) { return load_vec3(job_.colours + 3 * index); };
            switch (job_.albedo) {
                case Albedo::gray:
                    path.throughput = path.throughput * gray_albedo;
                    break;
                case Albedo::normals:
                    path.throughput = path.throughput * (normal * 0.5f + Vec3{0.5f, 0.5f, 0.5f});
                    break;
                case Albedo::of_faces:
                    path.throughput = path.throughput * colour(prim);
                    break;
                case Albedo::of_vertices:
                    path.throughput =
                        path.throughput * weighted(colour(vertex[0]), colour(vertex[1]), colour(vertex[2]));
                    break;
            }
            const Vec3 a = load_vec3(corner[0]), point = weighted(a, load_vec3(corner[1]), load_vec3(corner[2]));
            const Vec3 facing = dot(normal, incoming) > 0 ? normal * -1.0f : normal;
            const auto random = pcg4d(pixel_index(row, x_begin, path.pixel), path.sample,
                                      static_cast<std::uint32_t>(bounce + 1), job_.seed);
            const Vec3 origin =
                point + facing * (surface_offset * std::max(largest_component(point), largest_component(a)));
            paths_[alive++] = path;
            push(next_origins_, origin);
            push(next_directions_, cosine_direction(facing, to_unit(random[0]), to_unit(random[1])));
            const float cosine = dot(facing, job_.light.to_sun);
            if (!has_sun || !(cosine > 0)) continue;
            sun_rays_.push_back({path.throughput * job_.light.sun * cosine, path.slot});
            push(sun_origins_, origin);
            push(sun_directions_, job_.light.toward_sun(to_unit(random[2]), to_unit(random[3])));
        }
        paths_.resize(alive);
        origins_.swap(next_origins_);
        directions_.swap(next_directions_);
    }

    // Adds the sun's light to paths whose rays towards it are free.
    void add_sun() {
        const std::size_t count = sun_rays_.size();
        if (count == 0) return;
        if (job_.tracer.function) {
            trace(sun_origins_, sun_directions_, count);
        } else {
            if (count > shadow_room_) {
                shadowed_ = std::make_unique<bool[]>(count);
                shadow_room_ = count;
            }
            HitBatch<float> hits;
            hits.occluded = shadowed_.get();
            run(QueryKind::any, sun_origins_, sun_directions_, hits, count);
        }
        for (std::size_t i = 0; i < count; ++i) {
            Vec3& light = light_[sun_rays_[i].slot];
            if (!(job_.tracer.function ? has_hit(i) : shadowed_[i])) light = light + sun_rays_[i].light;
        }
    }

    static constexpr float zero = 0, infinity = std::numeric_limits<float>::infinity();
    const RenderJob& job_;
    std::vector<Path> paths_;
    std::vector<Vec3> light_;  // of each path that was started
    std::vector<float> origins_, directions_, next_origins_, next_directions_, t_, uv_;
    std::vector<std::int32_t> prim_;
    std::vector<SunRay> sun_rays_;
    std::vector<float> sun_origins_, sun_directions_;
    std::unique_ptr<bool[]> shadowed_;
    std::size_t shadow_room_ = 0;
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
