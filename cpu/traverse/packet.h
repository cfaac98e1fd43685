// Packets of coherent rays: neighbours in the batch with close origins and similar directions.
//
// Coherent rays visit the same nodes. One walk through the tree visits the nodes that any ray of the packet may meet
// (packet_slabs.h), at the cost of one or two rays. At a leaf, the rays that meet its box are found eight at a time,
// and each of them is tested as a single ray is. If boxes lie within their parents' boxes, a ray that meets a leaf's
// box meets all boxes above it: every ray is tested against the same leaves in the same order as in single-ray
// traversal, and its hits are the same bits.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>

#include "traverse/packet_slabs.h"
#include "traverse/traversal.h"

namespace wive::WIVE_ISA {

template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query>
    requires Traversable<I, Slabs, Triangles, Query>
class Packet {
    using Real = typename I::Real;
    using Real4 = typename I::Real4;
    using Float4 = typename I::Float4;
    using Float8 = typename I::Float8;
    using Rays = RayBatch<Real>;
    using Hits = HitBatch<Real>;
    using Layout = typename Slabs<I>::Layout;
    using Node = typename Layout::Node;
    using Block = typename Layout::Block;
    using Corners = typename Layout::template Corners<I>;
    using Frame = typename Triangles<I>::Frame;

public:
    static constexpr unsigned packet_size = 16;
    // Packets give the single ray's bits only if boxes nest or the triangle test accepts no hit outside its leaf's box:
    // otherwise a packet might reach a leaf that the single ray skips, and accept a hit there.
    static constexpr bool bit_exact = Layout::boxes_are_nested || Triangles<I>::hits_are_in_boxes;

    enum class Outcome { refused, worthwhile, not_worthwhile };

    Packet(const BvhView& bvh, const Rays& rays, const Hits& hits) : bvh_(bvh), rays_(rays), hits_(hits) {}

    // Traces rays [first, first + packet_size) and writes their hits, or refuses to if they are not coherent.
    [[gnu::noinline]] Outcome trace(std::size_t first) {
        if (!are_coherent(first, packet_size - 1) || !are_coherent(first, 1) || !load(first)) return Outcome::refused;
        walk_packet();
        for (unsigned i = 0; i < packet_size; ++i) query_[i].write(hits_, first + i, ray_[i].scale);
        return rays_at_leaves_ >= worthwhile_rays_per_leaf * leaves_ ? Outcome::worthwhile : Outcome::not_worthwhile;
    }

private:
    // Rays that meet the box of a leaf the packet visits, on average; with fewer, rays in flight are faster.
    static constexpr unsigned worthwhile_rays_per_leaf = 2;

    // The largest difference between the rays' directions, relative to their longest component, and between their
    // origins, relative to the tree's extent.
    static constexpr float max_turn = 1.0f / 8, max_shift = 1.0f / 16;

    // A ray that may hit some of a block's triangles.
    struct Candidate {
        unsigned ray;
        typename Triangles<I>::Found found;
    };

    // Compares every step-th ray. NaN and infinity are left to load().
    bool are_coherent(std::size_t first, unsigned step) const {
        const auto vector = [](const Real* p, std::size_t i) {
            return Real4::set(p[3 * i], p[3 * i + 1], p[3 * i + 2], 0);
        };
        Real4 low_origin = vector(rays_.origins, first), high_origin = low_origin;
        Real4 low_direction = vector(rays_.directions, first), high_direction = low_direction;
        for (std::size_t i = first + step; i < first + packet_size; i += step) {
            const Real4 origin = vector(rays_.origins, i), direction = vector(rays_.directions, i);
            low_origin = min(low_origin, origin);
            high_origin = max(high_origin, origin);
            low_direction = min(low_direction, direction);
            high_direction = max(high_direction, direction);
        }
        const Real longest = highest_lane(max(abs(low_direction), abs(high_direction)));
        const float extent = highest_lane(Float4::load(bvh_.extent));
        return (highest_lane(high_direction - low_direction) <= max_turn * longest) &
               (highest_lane(high_origin - low_origin) <= max_shift * extent);
    }

    // Returns false if a ray hits nothing by rule, or if the rays differ in octant or in scale, which would make the
    // bounds loose.
    bool load(std::size_t first) {
        Float4 low_rdir{}, high_rdir{}, low_origin{}, high_origin{};
        bounds_.tmin = std::numeric_limits<float>::infinity();
        for (unsigned i = 0; i < packet_size; ++i) {
            Frame& ray = ray_[i];
            if (!ray.load(bvh_, rays_, first + i)) return false;
            if ((ray.order_shift != ray_[0].order_shift) | (ray.scale != ray_[0].scale)) return false;
            assert(ray.is_finite());
            const Float4 rdir = Float4::load(ray.rdir);
            const Float4 origin = Float4::narrow(Real4::load(ray.origin) - Real4::of(Float4::load(bvh_.center)));
            low_rdir = i == 0 ? rdir : min(low_rdir, rdir);
            high_rdir = i == 0 ? rdir : max(high_rdir, rdir);
            low_origin = i == 0 ? origin : min(low_origin, origin);
            high_origin = i == 0 ? origin : max(high_origin, origin);
            for (unsigned axis = 0; axis < 3; ++axis) {
                rdir_[axis][i] = ray.rdir[axis];
                near_bias_[axis][i] = ray.near_bias[axis];
                far_bias_[axis][i] = ray.far_bias[axis];
            }
            tmin_[i] = ray.interval.box_tmin();
            tmax_[i] = ray.interval.box_tmax();
            bounds_.tmin = tmin_[i] < bounds_.tmin ? tmin_[i] : bounds_.tmin;
            new (&query_[i]) Query(start_query<Query>(ray, hits_, first + i));
        }
        set_bounds(low_rdir, high_rdir, low_origin, high_origin, Float4::load(bvh_.extent));
        return true;
    }

    void set_bounds(Float4 low_rdir, Float4 high_rdir, Float4 low_origin, Float4 high_origin, Float4 extent) {
        constexpr float least_magnitude = 0x1p-100f, slack_factor = 0x1p-18f;  // 64u; as in frame.h, u = 2^-24
        const float magnitude = highest_lane(extent + max(abs(low_origin), abs(high_origin))) + least_magnitude;
        const Float4 slack = Float4::all(magnitude * slack_factor);
        alignas(16) float rdir[2][4], behind[4], ahead[4];
        low_rdir.store(rdir[0]);
        high_rdir.store(rdir[1]);
        (low_origin - slack).store(behind);
        (high_origin + slack).store(ahead);
        for (unsigned axis = 0; axis < 3; ++axis) {
            const bool negative = rdir[0][axis] < 0;
            bounds_.near_origin[axis] = negative ? behind[axis] : ahead[axis];
            bounds_.far_origin[axis] = negative ? ahead[axis] : behind[axis];
            for (unsigned end = 0; end < 2; ++end) bounds_.rdir[end][axis] = rdir[end][axis];
            bounds_.near_row[axis] = ray_[0].near_row[axis];
            bounds_.far_row[axis] = ray_[0].far_row[axis];
        }
        bounds_.order_shift = ray_[0].order_shift;
    }

    [[gnu::noinline]] void walk_packet() {
        leaves_ = rays_at_leaves_ = 0;
        float box_tmax = farthest_tmax();
        // A leaf's box is in its parent, so each entry of the stack has its parent beside it, at the same index.
        const auto parent_at = [&](const Stack::Top& top) { return parents_ + (&top.distance() - stack_.distances); };
        walk<Query::in_order, I>(
            bvh_, PacketSlabs<I, Layout>(bounds_), stack_, [&] { return box_tmax; },
            [&](std::uint32_t child, const Stack::Top& top) {
                for (int i = 0; i < node_width; ++i) parent_at(top)[i] = child;
            },
            [&](std::uint32_t child, const Stack::Top& top) {
                const Node& parent = bvh_.template node<Layout>(*parent_at(top));
                unsigned rays = rays_meeting_box(parent, I::Hits::of_child(parent.child, child).first());
                ++leaves_;
                rays_at_leaves_ += static_cast<unsigned>(__builtin_popcount(rays));
                const Block* block = bvh_.template leaf<Layout>(child);
                bool found = false;
                for (std::uint32_t count = leaf_block_count(child); rays != 0 && count > 0;
                     --count, block = block->next())
                    found |= test_block(*block, rays);
                if (found) box_tmax = farthest_tmax();
                return box_tmax == finished;
            });
    }

    // The mask of the rays that meet the box in a lane of a node.
    [[gnu::always_inline]] unsigned rays_meeting_box(const Node& node, unsigned lane) const {
        assert(lane < node_width);
        const OneChild<Float8> child{lane};
        unsigned rays = 0;
        for (unsigned i = 0; i < packet_size; i += node_width) {
            const auto distance = [&](std::size_t row, unsigned axis, const float* bias) {
                return Layout::distance(node, child, row, axis, Float8::load(rdir_[axis] + i), Float8::load(bias + i));
            };
            const auto boxes = intersect_boxes<I>(
                [&](unsigned axis) { return distance(bounds_.near_row[axis], axis, near_bias_[axis]); },
                [&](unsigned axis) { return distance(bounds_.far_row[axis], axis, far_bias_[axis]); },
                Float8::load(tmin_ + i), Float8::load(tmax_ + i));
            rays |= boxes.hit.bits() << i;
        }
        return rays;
    }

    // Tests the given rays, as test_leaves() in in_flight.h does: first find() for all, then solve() for the few that
    // may hit a triangle. Returns whether there were any, and clears the bits of rays whose query is done.
    [[gnu::always_inline]] bool test_block(const Block& block, unsigned& rays) {
        const Corners corners(block);
        Candidate* end = candidates_;
        for (unsigned left = rays; left != 0; left &= left - 1) {
            const auto i = static_cast<unsigned>(__builtin_ctz(left));
            *end = {i, Triangles<I>(ray_[i]).find(corners)};
            end += end->found.hit_mask != 0;
        }
        for (const Candidate* c = candidates_; c != end; ++c) {
            const bool done = Triangles<I>(ray_[c->ray]).solve(corners, c->found, query_[c->ray]);
            tmax_[c->ray] = done ? finished : query_[c->ray].interval.box_tmax();
            rays &= ~(static_cast<unsigned>(done) << c->ray);
        }
        return end != candidates_;
    }

    float farthest_tmax() const {
        Float8 farthest = Float8::load(tmax_);
        for (unsigned i = node_width; i < packet_size; i += node_width)
            farthest = max(farthest, Float8::load(tmax_ + i));
        return highest_lane(farthest);
    }

    static constexpr float finished = -std::numeric_limits<float>::infinity();  // tmax of a ray whose query is done

    const BvhView bvh_;
    const Rays rays_;
    const Hits hits_;
    alignas(64) float rdir_[3][packet_size],
        near_bias_[3][packet_size], far_bias_[3][packet_size], tmin_[packet_size], tmax_[packet_size];
    PacketBounds bounds_;
    unsigned leaves_ = 0, rays_at_leaves_ = 0;
    Frame ray_[packet_size];
    Query query_[packet_size];
    Candidate candidates_[packet_size + 1];
    Stack stack_;
    std::uint32_t parents_[Stack::size];
};

// Decides which rays of a thread are traced in packets.
template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query>
class Packets {
    using OnePacket = Packet<I, Slabs, Triangles, Query>;

public:
    static constexpr bool bit_exact = OnePacket::bit_exact;

    // None if fewer rays are in flight than a packet has.
    Packets(const BvhView& bvh, const auto& rays, const auto& hits, unsigned in_flight)
        : next_try_(in_flight < OnePacket::packet_size ? std::numeric_limits<std::size_t>::max() : 0),
          packet_(bvh, rays, hits) {}

    // Traces the rays from `next` on as a packet if there are enough and they are coherent; returns true then, with
    // `next` moved past them. After a packet that was refused or not worthwhile, more and more rays are skipped before
    // the next attempt.
    [[gnu::always_inline]] bool trace_next(std::size_t& next, std::size_t end) {
        if (next < next_try_ || end - next < OnePacket::packet_size) return false;
        const auto outcome = packet_.trace(next);
        const bool traced = outcome != OnePacket::Outcome::refused;
        if (traced) next += OnePacket::packet_size;
        if (outcome == OnePacket::Outcome::worthwhile) {
            pause_ = 0;
        } else {
            next_try_ = next + pause_;
            pause_ = pause_ < longest_pause ? 2 * pause_ + OnePacket::packet_size : longest_pause;
        }
        return traced;
    }

private:
    static constexpr std::size_t longest_pause = 496;  // 16, 48, 112, 240, 496

    std::size_t next_try_, pause_ = 0;  // in rays
    OnePacket packet_;
};

struct NoPackets {
    [[gnu::always_inline]] NoPackets(const BvhView&, const auto&, const auto&, unsigned) {}
    [[gnu::always_inline]] static bool trace_next(std::size_t, std::size_t) { return false; }
};

}  // namespace wive::WIVE_ISA
