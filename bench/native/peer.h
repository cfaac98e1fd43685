// What a peer's shim gives to ctypes: a tree over one mesh, and its closest and any hits one ray at a time.
#pragma once

#include <cstddef>
#include <cstdint>

// Arrays as NumPy holds them: vertices (v,3), faces (f,3), rays (n,3) with 0 <= t <= tmax.
struct PeerMesh {
    const float* vertices;
    std::size_t vertex_count;
    const std::uint32_t* faces;
    std::size_t face_count;
};

struct PeerRays {
    std::size_t count;
    const float *origins, *directions;
    float tmax;
};

class Peer;

extern "C" {
Peer* peer_build(const PeerMesh* mesh, int high);  // nullptr if there is no such quality
void peer_release(Peer* peer);
void peer_intersect(const Peer* peer, const PeerRays* rays, std::uint8_t* hit);
void peer_occluded(const Peer* peer, const PeerRays* rays, std::uint8_t* hit);
}
