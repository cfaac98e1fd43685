// A path tracer with a white sky and diffuse surfaces: the paper's benchmark, and a picture of a mesh.
#pragma once

#include <cstdint>

#include "kernels.h"
#include "mesh.h"
#include "vec3.h"

namespace wive {

struct Camera {
    Vec3 eye, centre, right, up;  // from the eye to the picture's centre, from there to its right and its top edge
};

enum class Albedo { gray, normals };

struct RenderJob {
    BvhView bvh;
    Mesh mesh;
    const KernelTable& kernels;  // the only thing that differs between instruction sets
    Accuracy accuracy;
    NodeForm nodes;
    Camera camera;
    int width, height;
    int samples, bounces;
    Albedo albedo;
    std::uint32_t seed;
    float* image;  // (height, width, 3), linear radiance, row 0 at the top
};

// Traces rows [row_begin, row_end) and returns how many rays that took.
std::uint64_t render_rows(const RenderJob& job, int row_begin, int row_end, unsigned threads);

}  // namespace wive
