// A path tracer with a white sky and diffuse surfaces: the paper's benchmark, and a picture of a mesh.
#pragma once

#include <cstddef>
#include <cstdint>

#include "build/mesh.h"
#include "core/vec3.h"
#include "kernels/kernels.h"

namespace wive {

struct Camera {
    Vec3 eye, centre, right, up;  // from the eye to the picture's centre, from there to its right and its top edge
};

enum class Albedo { gray, normals };

// Closest hits of a batch by somebody else's traversal, for comparisons in which nothing else differs: rays (count, 3),
// one interval for all; prim -1 on a miss, uv (count, 2) as Embree has it. Called by every rendering thread.
struct ForeignTracer {
    using Function = void (*)(const void* context, std::size_t count, const float* origins, const float* directions,
                              float tmin, float tmax, float* t, std::int32_t* prim, float* uv);
    Function function = nullptr;  // null: wive's own kernels
    const void* context = nullptr;
};

struct RenderJob {
    BvhView bvh;
    Mesh<float> mesh;
    const KernelTable<float>& kernels;  // the only thing that differs between instruction sets
    Accuracy accuracy;
    NodeForm nodes;
    Camera camera;
    int width, height;
    int samples, bounces;
    Albedo albedo;
    std::uint32_t seed;
    float* image;            // (height, width, 3), linear radiance, row 0 at the top
    unsigned in_flight = 0;  // rays interleaved by each thread; 0: chosen by the batch
    ForeignTracer tracer = {};
};

// Traces rows [row_begin, row_end) and returns how many rays that took.
std::uint64_t render_rows(const RenderJob& job, int row_begin, int row_end, unsigned threads);

}  // namespace wive
