// Embree's calls for one ray and for packets of 8 and 16 in a loop over arrays, as C functions for ctypes.
//
// The embreex wheel carries Embree's shared library but no headers, so the few types and constants of Embree 4's
// C interface that are needed are defined here (names and values: include/embree4 of Embree 4.4, Apache-2.0).
// The loops call Embree as a C++ user would: one ray structure on the stack, arguments and context made once.

#include <dlfcn.h>
#include <xmmintrin.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace {

// ---- Embree's interface -------------------------------------------------------------------------------------

using Handle = void*;  // RTCDevice, RTCScene, RTCGeometry
constexpr unsigned invalid_id = ~0u;

struct alignas(16) Ray {
    float org_x, org_y, org_z, tnear;
    float dir_x, dir_y, dir_z, time;
    float tfar;
    unsigned mask, id, flags;
};

struct alignas(16) Hit {
    float ng_x, ng_y, ng_z, u, v;
    unsigned prim, geometry, instance, instance_prim;
};

struct RayHit {
    Ray ray;
    Hit hit;
};
static_assert(sizeof(Ray) == 48 && sizeof(RayHit) == 96);

// RTCRayN and RTCHitN: a row per field.
template <unsigned width>
struct alignas(4 * width) RayHitPacket {
    float org_x[width], org_y[width], org_z[width], tnear[width];
    float dir_x[width], dir_y[width], dir_z[width], time[width];
    float tfar[width];
    unsigned mask[width], id[width], flags[width];
    float ng_x[width], ng_y[width], ng_z[width], u[width], v[width];
    unsigned prim[width], geometry[width], instance[width], instance_prim[width];
};
static_assert(sizeof(RayHitPacket<16>) == 21 * 64);

struct QueryContext {
    unsigned instance, instance_prim;
};

struct QueryArguments {  // RTCIntersectArguments and RTCOccludedArguments have the same layout
    int flags = 0;       // RTC_RAY_QUERY_FLAG_INCOHERENT
    unsigned features = ~0u;
    QueryContext* context = nullptr;
    void* filter = nullptr;
    void* callback = nullptr;
};

constexpr int query_flag_coherent = 1 << 16;
constexpr int scene_flag_robust = 4;
constexpr int geometry_type_triangle = 0;
constexpr int buffer_type_index = 0, buffer_type_vertex = 1;
constexpr int format_uint3 = 0x5003, format_float3 = 0x9003;

// The entry points by their names in the library; resolve() sets them.
#define EMBREE_FUNCTIONS(X)                                                                            \
    X(rtcNewDevice, Handle, (const char*))                                                             \
    X(rtcReleaseDevice, void, (Handle))                                                                \
    X(rtcGetDeviceError, int, (Handle))                                                                \
    X(rtcGetDeviceProperty, std::ptrdiff_t, (Handle, int))                                             \
    X(rtcSetDeviceMemoryMonitorFunction, void, (Handle, bool (*)(void*, std::ptrdiff_t, bool), void*)) \
    X(rtcNewScene, Handle, (Handle))                                                                   \
    X(rtcReleaseScene, void, (Handle))                                                                 \
    X(rtcSetSceneFlags, void, (Handle, int))                                                           \
    X(rtcSetSceneBuildQuality, void, (Handle, int))                                                    \
    X(rtcCommitScene, void, (Handle))                                                                  \
    X(rtcNewGeometry, Handle, (Handle, int))                                                           \
    X(rtcReleaseGeometry, void, (Handle))                                                              \
    X(rtcSetSharedGeometryBuffer, void,                                                                \
      (Handle, int, unsigned, int, const void*, std::size_t, std::size_t, std::size_t))                \
    X(rtcSetGeometryBuildQuality, void, (Handle, int))                                                 \
    X(rtcCommitGeometry, void, (Handle))                                                               \
    X(rtcAttachGeometry, unsigned, (Handle, Handle))                                                   \
    X(rtcIntersect1, void, (Handle, RayHit*, QueryArguments*))                                         \
    X(rtcOccluded1, void, (Handle, Ray*, QueryArguments*))                                             \
    X(rtcIntersect8, void, (const int*, Handle, RayHitPacket<8>*, QueryArguments*))                    \
    X(rtcIntersect16, void, (const int*, Handle, RayHitPacket<16>*, QueryArguments*))

#define DECLARE(name, result, arguments) result(*name) arguments = nullptr;
EMBREE_FUNCTIONS(DECLARE)
#undef DECLARE

// ---- one mesh ------------------------------------------------------------------------------------------------

struct Mesh {
    std::vector<float> vertices;  // padded: Embree reads 16 bytes at the last vertex
    std::vector<std::uint32_t> faces;
    std::atomic<std::ptrdiff_t> bytes{0};
    Handle device = nullptr, scene = nullptr;

    ~Mesh() {
        if (scene) rtcReleaseScene(scene);
        if (device) rtcReleaseDevice(device);
    }
};

bool count_bytes(void* mesh, std::ptrdiff_t bytes, bool) {
    static_cast<Mesh*>(mesh)->bytes += bytes;
    return true;
}

// Arrays as NumPy holds them: rays (n,3); tmin and tmax have n elements (step 1) or one (step 0).
struct Rays {
    std::size_t count;
    const float *origins, *directions, *tmin, *tmax;
    std::size_t tmin_step, tmax_step;

    void load(std::size_t i, Ray& ray) const {
        ray.org_x = origins[3 * i], ray.org_y = origins[3 * i + 1], ray.org_z = origins[3 * i + 2];
        ray.dir_x = directions[3 * i], ray.dir_y = directions[3 * i + 1], ray.dir_z = directions[3 * i + 2];
        ray.tnear = tmin[i * tmin_step];
        ray.tfar = tmax[i * tmax_step];
    }
};
static_assert(std::is_standard_layout_v<Rays>);

Ray constant_fields() {
    Ray ray{};
    ray.mask = ~0u;
    return ray;
}

// Closest hits of the rays in packets of consecutive ones; the last may have fewer.
template <unsigned width>
void intersect_packets(void (*trace)(const int*, Handle, RayHitPacket<width>*, QueryArguments*), const Mesh& mesh,
                       const Rays& rays, float* t, std::int32_t* prim, float* uv) {
    QueryContext context{invalid_id, invalid_id};
    QueryArguments arguments;
    arguments.context = &context;
    arguments.flags = query_flag_coherent;  // what a user of packets would ask for
    RayHitPacket<width> packet{};
    alignas(4 * width) int valid[width];
    for (std::size_t first = 0; first < rays.count; first += width) {
        const auto used = static_cast<unsigned>(std::min<std::size_t>(width, rays.count - first));
        for (unsigned i = 0; i < used; ++i) {
            Ray ray = constant_fields();
            rays.load(first + i, ray);
            packet.org_x[i] = ray.org_x, packet.org_y[i] = ray.org_y, packet.org_z[i] = ray.org_z;
            packet.dir_x[i] = ray.dir_x, packet.dir_y[i] = ray.dir_y, packet.dir_z[i] = ray.dir_z;
            packet.tnear[i] = ray.tnear, packet.tfar[i] = ray.tfar;
        }
        for (unsigned i = 0; i < width; ++i) {
            valid[i] = i < used ? -1 : 0;
            packet.mask[i] = ~0u;
            packet.prim[i] = packet.geometry[i] = packet.instance[i] = invalid_id;
        }
        trace(valid, mesh.scene, &packet, &arguments);
        for (unsigned i = 0; i < used; ++i) {
            t[first + i] = packet.tfar[i];
            prim[first + i] = static_cast<std::int32_t>(packet.prim[i]);
            uv[2 * (first + i)] = packet.u[i];
            uv[2 * (first + i) + 1] = packet.v[i];
        }
    }
}

}  // namespace

extern "C" {

// Opens Embree's shared library; returns an error message, or nullptr.
const char* shim_open(const char* path) {
    static std::string problem;
    void* library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) return (problem = dlerror()).c_str();
#define RESOLVE(name, result, arguments)                                 \
    name = reinterpret_cast<result(*) arguments>(dlsym(library, #name)); \
    if (!name) return (problem = std::string(path) + " lacks " #name).c_str();
    EMBREE_FUNCTIONS(RESOLVE)
#undef RESOLVE
    return nullptr;
}

// A device with one triangle mesh, not yet built; nullptr if Embree refuses the configuration.
Mesh* shim_create(const char* config, const float* vertices, std::size_t vertex_count, const std::uint32_t* faces,
                  std::size_t face_count, int robust, int quality) {
    auto mesh = std::make_unique<Mesh>();
    mesh->vertices.assign(vertices, vertices + 3 * vertex_count);
    mesh->vertices.resize(3 * vertex_count + 1);
    mesh->faces.assign(faces, faces + 3 * face_count);
    mesh->device = rtcNewDevice(config);
    if (!mesh->device) return nullptr;
    rtcSetDeviceMemoryMonitorFunction(mesh->device, count_bytes, mesh.get());

    const Handle geometry = rtcNewGeometry(mesh->device, geometry_type_triangle);
    rtcSetSharedGeometryBuffer(geometry, buffer_type_vertex, 0, format_float3, mesh->vertices.data(), 0, 12,
                               vertex_count);
    rtcSetSharedGeometryBuffer(geometry, buffer_type_index, 0, format_uint3, mesh->faces.data(), 0, 12, face_count);
    rtcSetGeometryBuildQuality(geometry, quality);
    rtcCommitGeometry(geometry);

    mesh->scene = rtcNewScene(mesh->device);
    rtcSetSceneFlags(mesh->scene, robust ? scene_flag_robust : 0);
    rtcSetSceneBuildQuality(mesh->scene, quality);
    rtcAttachGeometry(mesh->scene, geometry);
    rtcReleaseGeometry(geometry);
    return rtcGetDeviceError(mesh->device) == 0 ? mesh.release() : nullptr;
}

// Builds the tree; returns the seconds of rtcCommitScene, negative if Embree reports an error.
double shim_commit(Mesh* mesh) {
    const auto start = std::chrono::steady_clock::now();
    rtcCommitScene(mesh->scene);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    return rtcGetDeviceError(mesh->device) == 0 ? seconds.count() : -1.0;
}

void shim_release(Mesh* mesh) { delete mesh; }

// Bytes that Embree has allocated for the mesh; the vertex and index arrays are not Embree's and don't count.
std::ptrdiff_t shim_bytes(const Mesh* mesh) { return mesh->bytes; }

std::ptrdiff_t shim_property(const Mesh* mesh, int property) { return rtcGetDeviceProperty(mesh->device, property); }

// Sets or clears flush-to-zero and denormals-are-zero on the calling thread; returns the former control word.
unsigned shim_flush_denormals(int enabled) {
    constexpr unsigned flush_to_zero = 0x8000, denormals_are_zero = 0x0040;
    const unsigned before = _mm_getcsr();
    const unsigned both = flush_to_zero | denormals_are_zero;
    _mm_setcsr(enabled ? before | both : before & ~both);
    return before;
}

// Gives freed memory back to the system, if the allocator can.
void shim_trim_heap() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

void shim_restore_control(unsigned word) { _mm_setcsr(word); }

// width: rays per call, 1, 8 or 16.
void shim_intersect(const Mesh* mesh, const Rays* rays, unsigned width, float* t, std::int32_t* prim, float* uv) {
    if (width == 8) return intersect_packets<8>(rtcIntersect8, *mesh, *rays, t, prim, uv);
    if (width == 16) return intersect_packets<16>(rtcIntersect16, *mesh, *rays, t, prim, uv);
    QueryContext context{invalid_id, invalid_id};
    QueryArguments arguments;
    arguments.context = &context;
    RayHit query{constant_fields(), Hit{}};
    for (std::size_t i = 0; i < rays->count; ++i) {
        rays->load(i, query.ray);
        query.hit.prim = query.hit.geometry = query.hit.instance = invalid_id;
        rtcIntersect1(mesh->scene, &query, &arguments);
        t[i] = query.ray.tfar;
        prim[i] = static_cast<std::int32_t>(query.hit.prim);
        uv[2 * i] = query.hit.u;
        uv[2 * i + 1] = query.hit.v;
    }
}

// Closest hits for wive's renderer: a ForeignTracer (cpu/render/render.h) with the mesh as its context.
void shim_trace(const void* mesh, std::size_t count, const float* origins, const float* directions, float tmin,
                float tmax, float* t, std::int32_t* prim, float* uv) {
    const Rays rays{count, origins, directions, &tmin, &tmax, 0, 0};
    shim_intersect(static_cast<const Mesh*>(mesh), &rays, 1, t, prim, uv);
}

void shim_occluded(const Mesh* mesh, const Rays* rays, std::uint8_t* occluded) {
    QueryContext context{invalid_id, invalid_id};
    QueryArguments arguments;
    arguments.context = &context;
    Ray ray = constant_fields();
    for (std::size_t i = 0; i < rays->count; ++i) {
        rays->load(i, ray);
        rtcOccluded1(mesh->scene, &ray, &arguments);
        occluded[i] = ray.tfar < 0.0f;  // Embree reports a hit by tfar = -inf
    }
}

}  // extern "C"
