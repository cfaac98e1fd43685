// A path tracer of diffuse surfaces under a sky and a sun: the paper's benchmark, and pictures of meshes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "build/mesh.h"
#include "core/vec3.h"
#include "kernels/kernels.h"
#include "render/light.h"

namespace wive {

struct Camera {
    Vec3 eye, centre, right, up;  // eye to picture centre; centre to its right and to its top edge
};

enum class Albedo { gray, normals, of_faces, of_vertices };

// The closest hits of a batch by another traversal, for comparisons in which nothing else differs. Rays are (count, 3),
// with one interval for all; prim is -1 on a miss, uv (count, 2) in Embree's convention. Every rendering thread calls
// it.
struct ForeignTracer {
    using Function = void (*)(const void* context, std::size_t count, const float* origins, const float* directions,
                              float tmin, float tmax, float* t, std::int32_t* prim, float* uv);
    Function function = nullptr;  // null: wive's own kernels
    const void* context = nullptr;
};

struct RenderJob {
    BvhView bvh;
    Mesh<float> mesh;
    const KernelTable<float>& kernels;  // of one instruction set; nothing else depends on it
    Accuracy accuracy;
    NodeForm nodes;
    Camera camera;
    int width, height;
    int samples, bounces;
    Albedo albedo;
    std::uint32_t seed;
    float* image;            // (height, width, 3), linear radiance, row 0 at the top
    unsigned in_flight = 0;  // rays interleaved per thread; 0: chosen by the batch's size
    ForeignTracer tracer = {};
    Light light = white_sky;
    const float* colours = nullptr;  // (face_count, 3) or (vertex_count, 3), if the albedo is theirs
};

// Renders rows [row_begin, row_end). Returns the number of rays traced.
std::uint64_t render_rows(const RenderJob& job, int row_begin, int row_end, unsigned threads);

}  // namespace wive
