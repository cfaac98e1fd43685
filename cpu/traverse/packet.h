// Rays that go together: neighbours in the batch, close to each other and in much the same direction.
//
// Such rays meet the same nodes. One walk through the tree visits what any of them may meet (packet_slabs.h), for the
// price of one ray or two; at each leaf, the rays that meet its box are found eight at a time, and each of them is
// tested as it is when it is alone. Where boxes lie in their parents' boxes, a ray that meets a leaf's has met all
// above it: every ray comes to the leaves that it comes to alone, in the same order, and its hits are the same bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>

#include "traverse/packet_slabs.h"
#include "traverse/traversal.h"

namespace wive {

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query>
class Packet {
    using Real = typename Isa::Real;
    using Real4 = typename Isa::Real4;
    using Float4 = typename Isa::Float4;
    using Float8 = typename Isa::Float8;
    using Rays = RayBatch<Real>;
    using Hits = HitBatch<Real>;
    using Layout = typename Slabs<Isa>::Layout;
    using Node = typename Layout::Node;
    using Block = typename Layout::Block;
    using Corners = typename Layout::template Corners<Isa>;
    using Frame = typename Triangles<Isa>::Frame;

public:
    static constexpr unsigned width = 16;
    // Else a ray might come to a leaf that it does not come to alone, and accept what lies outside its box.
    static constexpr bool bit_exact = Layout::boxes_are_nested || Triangles<Isa>::hits_are_in_boxes;

    enum class Outcome { refused, worthwhile, not_worthwhile };

    Packet(const BvhView& bvh, const Rays& rays, const Hits& hits) : bvh_(bvh), rays_(rays), hits_(hits) {}

    // Answers rays [first, first + width), or refuses to where they don't go together.
    [[gnu::noinline]] Outcome trace(std::size_t first) {
        if (!go_together(first, width - 1) || !go_together(first, 1) || !load(first)) return Outcome::refused;
        walk_together();
        for (unsigned i = 0; i < width; ++i) query_[i].write(hits_, first + i, ray_[i].scale);
        return rays_at_leaves_ >= fewest_rays_a_leaf * leaves_ ? Outcome::worthwhile : Outcome::not_worthwhile;
    }

private:
    // Of a leaf that the packet comes to: with fewer, rays in flight are faster.
    static constexpr unsigned fewest_rays_a_leaf = 2;

    // How far the rays' directions may differ, in their longest component, and their origins, in the tree's extent.
    static constexpr float most_turn = 1.0f / 8, most_shift = 1.0f / 16;

    // A triangle block some of whose triangles a ray may hit.
    struct Candidate {
        unsigned ray;
        typename Triangles<Isa>::Found found;
    };

    // Of every step-th ray. What is no number is left to load().
    bool go_together(std::size_t first, unsigned step) const {
        const auto vector = [](const Real* p, std::size_t i) {
            return Real4::set(p[3 * i], p[3 * i + 1], p[3 * i + 2], 0);
        };
        Real4 low_origin = vector(rays_.origins, first), high_origin = low_origin;
        Real4 low_direction = vector(rays_.directions, first), high_direction = low_direction;
        for (std::size_t i = first + step; i < first + width; i += step) {
            const Real4 origin = vector(rays_.origins, i), direction = vector(rays_.directions, i);
            low_origin = min(low_origin, origin);
            high_origin = max(high_origin, origin);
            low_direction = min(low_direction, direction);
            high_direction = max(high_direction, direction);
        }
        const Real longest = highest_lane(max(abs(low_direction), abs(high_direction)));
        const float extent = highest_lane(Float4::load(bvh_.extent));
        return (highest_lane(high_direction - low_direction) <= most_turn * longest) &
               (highest_lane(high_origin - low_origin) <= most_shift * extent);
    }

    // False where a ray hits nothing by rule, or its octant is another's; or its scale, which would make the bounds
    // loose.
    bool load(std::size_t first) {
        Float4 low_rdir{}, high_rdir{}, low_origin{}, high_origin{};
        bounds_.tmin = std::numeric_limits<float>::infinity();
        for (unsigned i = 0; i < width; ++i) {
            Frame& ray = ray_[i];
            if (!ray.load(bvh_, rays_, first + i)) return false;
            if ((ray.order_shift != ray_[0].order_shift) | (ray.scale != ray_[0].scale)) return false;
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
            reach_[i] = ray.interval.box_tmax();
            bounds_.tmin = tmin_[i] < bounds_.tmin ? tmin_[i] : bounds_.tmin;
            new (&query_[i]) Query(query_of<Query>(ray, hits_, first + i));
        }
        set_bounds(low_rdir, high_rdir, low_origin, high_origin, Float4::load(bvh_.extent));
        return true;
    }

    void set_bounds(Float4 low_rdir, Float4 high_rdir, Float4 low_origin, Float4 high_origin, Float4 extent) {
        constexpr float least_reach = 0x1p-100f, slack_factor = 0x1p-18f;  // 64u; as in frame.h, u = 2^-24
        const float reach = highest_lane(extent + max(abs(low_origin), abs(high_origin))) + least_reach;
        const Float4 slack = Float4::all(reach * slack_factor);
        alignas(16) float rdir[2][4], behind[4], ahead[4];
        low_rdir.store(rdir[0]);
        high_rdir.store(rdir[1]);
        (low_origin - slack).store(behind);
        (high_origin + slack).store(ahead);
        for (unsigned axis = 0; axis < 3; ++axis) {
            const bool negative = rdir[0][axis] < 0;
            bounds_.near_from[axis] = negative ? behind[axis] : ahead[axis];
            bounds_.far_from[axis] = negative ? ahead[axis] : behind[axis];
            for (unsigned end = 0; end < 2; ++end) bounds_.rdir[end][axis] = rdir[end][axis];
            bounds_.near_row[axis] = ray_[0].near_row[axis];
            bounds_.far_row[axis] = ray_[0].far_row[axis];
        }
        bounds_.order_shift = ray_[0].order_shift;
    }

    [[gnu::noinline]] void walk_together() {
        leaves_ = rays_at_leaves_ = 0;
        float reach = farthest_reach();
        // A leaf's box stands in its parent. The children that a node leaves on the stack have its place beside them.
        const auto place = [&](const Stack::Top& top) { return parents_ + (&top.distance() - stack_.distances); };
        walk<Query::in_order, Isa>(
            bvh_, PacketSlabs<Isa, Layout>(bounds_), stack_, [&] { return reach; },
            [&](std::uint32_t child, const Stack::Top& top) {
                for (int i = 0; i < node_width; ++i) place(top)[i] = child;
            },
            [&](std::uint32_t child, const Stack::Top& top) {
                const Node& parent = bvh_.template node<Layout>(*place(top));
                unsigned rays = rays_at(parent, Isa::Hits::of_child(parent.child, child).first());
                ++leaves_;
                rays_at_leaves_ += static_cast<unsigned>(__builtin_popcount(rays));
                const Block* block = bvh_.template leaf<Layout>(child);
                bool found = false;
                for (std::uint32_t count = leaf_block_count(child); rays != 0 && count > 0;
                     --count, block = block->next())
                    found |= test_block(*block, rays);
                if (found) reach = farthest_reach();
                return reach == done;
            });
    }

    // Those that meet the box of one of a node's children, lane 0 lowest.
    [[gnu::always_inline]] unsigned rays_at(const Node& node, unsigned lane) const {
        const OneChild<Float8> child{lane};
        unsigned rays = 0;
        for (unsigned i = 0; i < width; i += node_width) {
            const auto distance = [&](std::size_t row, unsigned axis, const float* bias) {
                return Layout::distance(node, child, row, axis, Float8::load(rdir_[axis] + i), Float8::load(bias + i));
            };
            const auto meets = intersect_boxes<Isa>(
                [&](unsigned axis) { return distance(bounds_.near_row[axis], axis, near_bias_[axis]); },
                [&](unsigned axis) { return distance(bounds_.far_row[axis], axis, far_bias_[axis]); },
                Float8::load(tmin_ + i), Float8::load(reach_ + i));
            rays |= meets.hit.bits() << i;
        }
        return rays;
    }

    // As rays in flight do: first all are asked, then those few that may hit anything are solved. True if there were
    // any; those that ask nothing more are taken out of the rays.
    [[gnu::always_inline]] bool test_block(const Block& block, unsigned& rays) {
        const Corners corners(block);
        Candidate* end = candidates_;
        for (unsigned left = rays; left != 0; left &= left - 1) {
            const auto i = static_cast<unsigned>(__builtin_ctz(left));
            *end = {i, Triangles<Isa>(ray_[i]).find(corners)};
            end += end->found.lanes != 0;
        }
        for (const Candidate* c = candidates_; c != end; ++c) {
            const bool ends = Triangles<Isa>(ray_[c->ray]).solve(corners, c->found, query_[c->ray]);
            reach_[c->ray] = ends ? done : query_[c->ray].interval.box_tmax();
            rays &= ~(static_cast<unsigned>(ends) << c->ray);
        }
        return end != candidates_;
    }

    float farthest_reach() const {
        Float8 farthest = Float8::load(reach_);
        for (unsigned i = node_width; i < width; i += node_width) farthest = max(farthest, Float8::load(reach_ + i));
        return highest_lane(farthest);
    }

    static constexpr float done = -std::numeric_limits<float>::infinity();  // the reach of a ray that asks nothing more

    const BvhView bvh_;
    const Rays rays_;
    const Hits hits_;
    alignas(64) float rdir_[3][width], near_bias_[3][width], far_bias_[3][width], tmin_[width], reach_[width];
    PacketBounds bounds_;
    unsigned leaves_ = 0, rays_at_leaves_ = 0;
    Frame ray_[width];
    Query query_[width];
    Candidate candidates_[width + 1];
    Stack stack_;
    std::uint32_t parents_[Stack::size];
};

// The packets of one thread's share of a batch.
template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query>
class Packets {
    using Together = Packet<Isa, Slabs, Triangles, Query>;

public:
    static constexpr bool bit_exact = Together::bit_exact;

    // With fewer rays in flight than a packet has, there are none.
    Packets(const BvhView& bvh, const auto& rays, const auto& hits, unsigned in_flight)
        : next_try_(in_flight < Together::width ? std::numeric_limits<std::size_t>::max() : 0),
          packet_(bvh, rays, hits) {}

    // Answers rays from `next` on if enough of them go together, and moves next past them; true then. Where they don't,
    // or it did not pay, more and more of the rays behind are let pass before it is tried again.
    [[gnu::always_inline]] bool trace_next(std::size_t& next, std::size_t end) {
        if (next < next_try_ || end - next < Together::width) return false;
        const auto outcome = packet_.trace(next);
        const bool answered = outcome != Together::Outcome::refused;
        if (answered) next += Together::width;
        if (outcome == Together::Outcome::worthwhile) {
            pause_ = 0;
        } else {
            next_try_ = next + pause_;
            pause_ = pause_ < longest_pause ? 2 * pause_ + Together::width : longest_pause;
        }
        return answered;
    }

private:
    static constexpr std::size_t longest_pause = 496;  // 16, 48, 112, 240, 496

    std::size_t next_try_, pause_ = 0;  // in rays
    Together packet_;
};

struct NoPackets {
    [[gnu::always_inline]] NoPackets(const BvhView&, const auto&, const auto&, unsigned) {}
    [[gnu::always_inline]] static bool trace_next(std::size_t, std::size_t) { return false; }
};

}  // namespace wive
