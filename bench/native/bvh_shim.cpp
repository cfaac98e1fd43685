// madmann91/bvh, version 2: a binary tree. high: its builder of that name, with reinsertion.
#include <bvh/v2/bvh.h>
#include <bvh/v2/default_builder.h>
#include <bvh/v2/executor.h>
#include <bvh/v2/node.h>
#include <bvh/v2/ray.h>
#include <bvh/v2/stack.h>
#include <bvh/v2/thread_pool.h>
#include <bvh/v2/tri.h>
#include <bvh/v2/vec.h>

#include <vector>

#include "peer.h"

namespace v2 = bvh::v2;
using Vec3 = v2::Vec<float, 3>;
using Node = v2::Node<float, 3>;
using Tree = v2::Bvh<Node>;
using Ray = v2::Ray<float, 3>;

class Peer {
public:
    Peer(const PeerMesh& mesh, bool high) {
        v2::ThreadPool pool;
        v2::ParallelExecutor executor(pool);
        const auto corner = [&](std::size_t i) {
            const float* v = mesh.vertices + 3 * static_cast<std::size_t>(mesh.faces[i]);
            return Vec3(v[0], v[1], v[2]);
        };
        const auto triangle = [&](std::size_t i) {
            return v2::Tri<float, 3>(corner(3 * i), corner(3 * i + 1), corner(3 * i + 2));
        };
        std::vector<v2::BBox<float, 3>> boxes(mesh.face_count);
        std::vector<Vec3> centers(mesh.face_count);
        executor.for_each(0, mesh.face_count, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                boxes[i] = triangle(i).get_bbox();
                centers[i] = triangle(i).get_center();
            }
        });
        using Builder = v2::DefaultBuilder<Node>;
        Builder::Config config;
        config.quality = high ? Builder::Quality::High : Builder::Quality::Medium;
        tree_ = Builder::build(pool, boxes, centers, config);
        triangles_.resize(mesh.face_count);
        executor.for_each(0, mesh.face_count, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) triangles_[i] = triangle(tree_.prim_ids[i]);
        });
    }

    // any: whether the first hit found ends the search.
    template <bool any>
    void trace(const PeerRays& rays, std::uint8_t* hit) const {
        for (std::size_t i = 0; i < rays.count; ++i) {
            const float *o = rays.origins + 3 * i, *d = rays.directions + 3 * i;
            Ray ray(Vec3(o[0], o[1], o[2]), Vec3(d[0], d[1], d[2]), 0.0f, rays.tmax);
            v2::SmallStack<Tree::Index, 64> stack;
            bool found = false;
            tree_.intersect<any, false>(ray, tree_.get_root().index, stack, [&](std::size_t begin, std::size_t end) {
                for (std::size_t j = begin; j < end; ++j)
                    if (const auto at = triangles_[j].intersect(ray)) {
                        found = true;
                        ray.tmax = std::get<0>(*at);
                    }
                return found;
            });
            hit[i] = found;
        }
    }

private:
    Tree tree_;
    std::vector<v2::PrecomputedTri<float>> triangles_;
};

Peer* peer_build(const PeerMesh* mesh, int high) { return new Peer(*mesh, high != 0); }

void peer_release(Peer* peer) { delete peer; }

void peer_intersect(const Peer* peer, const PeerRays* rays, std::uint8_t* hit) { peer->trace<false>(*rays, hit); }

void peer_occluded(const Peer* peer, const PeerRays* rays, std::uint8_t* hit) { peer->trace<true>(*rays, hit); }
