// tinybvh's tree for CPUs with AVX2: eight wide, after the WiVe paper. high: spatial splits.
#include <algorithm>
#include <vector>

#define TINYBVH_IMPLEMENTATION
#include "peer.h"
#include "tiny_bvh.h"

class Peer {
public:
    Peer(const PeerMesh& mesh, bool high) : faces_(mesh.faces, mesh.faces + 3 * mesh.face_count) {
        vertices_.reserve(mesh.vertex_count);
        for (std::size_t i = 0; i < mesh.vertex_count; ++i) {
            const float* v = mesh.vertices + 3 * i;
            vertices_.emplace_back(v[0], v[1], v[2], 0.0f);
        }
        const tinybvh::bvhvec4slice slice(vertices_.data(), static_cast<std::uint32_t>(mesh.vertex_count));
        const auto count = static_cast<std::uint32_t>(mesh.face_count);
        if (high)
            tree.BuildHQ(slice, faces_.data(), count);
        else
            tree.Build(slice, faces_.data(), count);
    }

    tinybvh::BVH8_CPU tree;

private:
    std::vector<tinybvh::bvhvec4> vertices_;
    std::vector<std::uint32_t> faces_;
};

namespace {

tinybvh::Ray ray_of(const PeerRays& rays, std::size_t i) {
    const float *o = rays.origins + 3 * i, *d = rays.directions + 3 * i;
    return {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, std::min(rays.tmax, BVH_FAR)};
}

}  // namespace

Peer* peer_build(const PeerMesh* mesh, int high) { return new Peer(*mesh, high != 0); }

void peer_release(Peer* peer) { delete peer; }

void peer_intersect(const Peer* peer, const PeerRays* rays, std::uint8_t* hit) {
    const float far = std::min(rays->tmax, BVH_FAR);
    for (std::size_t i = 0; i < rays->count; ++i) {
        tinybvh::Ray ray = ray_of(*rays, i);
        peer->tree.Intersect(ray);
        hit[i] = ray.hit.t < far;
    }
}

void peer_occluded(const Peer* peer, const PeerRays* rays, std::uint8_t* hit) {
    for (std::size_t i = 0; i < rays->count; ++i) hit[i] = peer->tree.IsOccluded(ray_of(*rays, i));
}
