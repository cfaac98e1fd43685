// Packets of coherent rays: neighbours in the batch with close origins and similar directions.
//
// Coherent rays visit the same nodes. One walk through the tree visits the nodes that any ray of the packet may meet
// (packet_slabs.h), at the cost of one or two rays. At a leaf, the rays that meet its box are found eight at a time,
// and each of them is tested as a single ray is. If boxes lie within their parents' boxes, a ray that meets a leaf's
// box meets all boxes above it: every ray is tested against the same leaves in the same order as in single-ray
// traversal, and its hits are the same bits.
//
// Rays that lie farther apart than the boxes are large share only the upper nodes. So the rays that meet a child's box
// are counted before it is visited, which bounds what a packet can lose: when its steps cost more than the steps of
// single rays that they stand in for, the packet is split, and its rays are traced on in flight, each with the entries
// of the packet's stack that it meets.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>

#include "traverse/packet_slabs.h"
#include "traverse/pauses.h"
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
        Origins origins;
        if (!are_coherent(first, packet_size - 1, origins) || !are_coherent(first, 1, origins) || !load(first, origins))
            return Outcome::refused;
        first_ = first;
        entry_count_ = 0;
        split_rays_ = 0;
        walk_packet();
        for (unsigned i = 0; i < packet_size; ++i)
            if ((split_rays_ >> i & 1u) == 0) query_[i].write(hits_, first + i, ray_[i].unscale);
        return single_steps_ * worthwhile_ratio.den >= packet_steps_ * worthwhile_ratio.num ? Outcome::worthwhile
                                                                                            : Outcome::not_worthwhile;
    }

    // Rays of a split packet that are not finished.
    bool has_split_rays() const { return split_rays_ != 0; }

    // Moves one of them to a flight, with the entries of the packet's stack that it meets.
    [[gnu::noinline]] void take_split_ray(auto& flight) {
        const auto i = static_cast<unsigned>(__builtin_ctz(split_rays_));
        split_rays_ &= split_rays_ - 1;
        flight.ray = ray_[i];
        new (&flight.query) Query(query_[i]);
        flight.index = first_ + i;
        flight.top = Stack::Top(flight.stack);
        flight.top.move(-1);
        for (const Entry* entry = entries_; entry != entries_ + entry_count_; ++entry)
            if ((entry->rays >> i & 1u) != 0) {
                flight.top.move(1);
                flight.top.child() = entry->child;
                flight.top.distance() = entry->tnear[i];
            }
    }

private:
    // Costs in steps of single rays in flight, measured by `python -m bench packets`: of starting a packet, of a step
    // at a node, at a leaf and at a box that no ray meets, of splitting a packet, and of each entry of its stack then.
    static constexpr int start_cost = 4, node_cost = 3, leaf_cost = 3, skip_cost = 2, split_cost = 64, entry_cost = 3;
    // A packet is split when it has lost this many steps since it had saved most.
    static constexpr int most_lost_steps = 24;
    // A packet is worthwhile if its steps replace at least this many times their cost: the next rays form one as well.
    static constexpr struct {
        int num, den;
    } worthwhile_ratio = {3, 2};

    // The largest difference between the rays' directions, relative to their longest component, and between their
    // origins, relative to the tree's extent; and how far apart the rays may be at the tree's centre, relative to its
    // extent.
    static constexpr float max_turn = 1.0f / 8, max_shift = 1.0f / 16, max_width = 3.0f / 8;

    // An entry of the stack of a split packet: the rays that meet the child's box, and where.
    struct Entry {
        alignas(64) float tnear[packet_size];
        std::uint32_t child, rays;
    };

    // A ray that may hit some of a block's triangles.
    struct Candidate {
        unsigned ray;
        typename Triangles<I>::Found found;
    };

    // The extremes of the rays' origins on each axis.
    struct Origins {
        Real4 low, high;
    };

    // Compares every step-th ray. NaN and infinity are left to load().
    bool are_coherent(std::size_t first, unsigned step, Origins& origins) const {
        const auto vector = [](const Real* p, std::size_t i) {
            return Real4::set(p[3 * i], p[3 * i + 1], p[3 * i + 2], 0);
        };
        auto& [low_origin, high_origin] = origins;
        low_origin = high_origin = vector(rays_.origins, first);
        Real4 low_direction = vector(rays_.directions, first), high_direction = low_direction;
        for (std::size_t i = first + step; i < first + packet_size; i += step) {
            const Real4 origin = vector(rays_.origins, i), direction = vector(rays_.directions, i);
            low_origin = min(low_origin, origin);
            high_origin = max(high_origin, origin);
            low_direction = min(low_direction, direction);
            high_direction = max(high_direction, direction);
        }
        const Real longest = highest_lane(max(abs(low_direction), abs(high_direction)));
        const Real turn = highest_lane(high_direction - low_direction);
        const Real extent = highest_lane(Float4::load(bvh_.extent));
        const Real distance = highest_lane(abs(low_origin - Real4::of(Float4::load(bvh_.center))));
        return (turn <= max_turn * longest) & (highest_lane(high_origin - low_origin) <= max_shift * extent) &
               (turn * distance <= max_width * extent * longest);
    }

    // Returns false if a ray hits nothing by rule, if it starts elsewhere for boxes, or if the rays differ in octant or
    // in scale, which would make the bounds loose.
    bool load(std::size_t first, const Origins& origins) {
        const Float4 infinity = Float4::all(std::numeric_limits<float>::infinity()), zero = Float4::all(0);
        Float4 low_rdir = infinity, high_rdir = zero - infinity;
        for (unsigned i = 0; i < packet_size; ++i) {
            Frame& ray = ray_[i];
            if (!ray.load(bvh_, rays_, first + i)) return false;
            if ((ray.order_shift != ray_[0].order_shift) | (ray.unscale != ray_[0].unscale) | ray.has_box_start())
                return false;
            assert(ray.is_finite());
            const Float4 rdir = Float4::load(ray.rdir);
            low_rdir = min(low_rdir, rdir);
            high_rdir = max(high_rdir, rdir);
            new (&query_[i]) Query(start_query<Query>(ray, hits_, first + i));
        }
        Float4 least_tmin = infinity;
        for (unsigned i = 0; i < packet_size; i += 4) {
            const auto four = [&](auto of_ray) {
                return Float4::set(of_ray(ray_[i]), of_ray(ray_[i + 1]), of_ray(ray_[i + 2]), of_ray(ray_[i + 3]));
            };
            for (unsigned axis = 0; axis < 3; ++axis) {
                four([&](const Frame& ray) { return ray.rdir[axis]; }).store(rdir_[axis] + i);
                four([&](const Frame& ray) { return ray.near_bias[axis]; }).store(near_bias_[axis] + i);
                four([&](const Frame& ray) { return ray.far_bias[axis]; }).store(far_bias_[axis] + i);
            }
            const Float4 tmin = four([](const Frame& ray) { return ray.interval.box_tmin(); });
            tmin.store(tmin_ + i);
            least_tmin = min(least_tmin, tmin);
            four([](const Frame& ray) { return ray.interval.box_tmax(); }).store(tmax_ + i);
        }
        bounds_.tmin = -highest_lane(zero - least_tmin);
        const Real4 center = Real4::of(Float4::load(bvh_.center));
        set_bounds(low_rdir, high_rdir, Float4::narrow(origins.low - center), Float4::narrow(origins.high - center),
                   Float4::load(bvh_.extent));
        return true;
    }

    void set_bounds(Float4 low_rdir, Float4 high_rdir, Float4 low_origin, Float4 high_origin, Float4 extent) {
        constexpr float least_magnitude = 0x1p-100f, slack_factor = 0x1p-18f;  // 64u; as in frame.h, u = 2^-24
        Float4 magnitudes = max(abs(low_origin), abs(high_origin));
        if constexpr (!Triangles<I>::hits_are_in_boxes) magnitudes = magnitudes + extent;
        const float magnitude = highest_lane(magnitudes) + least_magnitude;
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
        packet_steps_ = start_cost + node_cost;  // the root, which is visited for all rays
        single_steps_ = packet_size;
        int most_saved = 0;
        float box_tmax = farthest_tmax();
        // A leaf's box is in its parent, so each entry of the stack has its parent beside it, at the same index.
        const auto parent_at = [&](const Stack::Top& top) { return parents_ + (&top.distance() - stack_.distances); };
        walk<Query::in_order, I>(
            bvh_, [&] { return PacketSlabs<I, Layout>(read_again(bounds_)); }, stack_, [&] { return box_tmax; },
            [&](std::uint32_t child, const Stack::Top& top) {
                if (child != inner_child(0)) {
                    const int rays = __builtin_popcount(rays_meeting_box(*parent_at(top), child));
                    count_step(rays, rays == 0 ? skip_cost : node_cost);
                    const int saved = single_steps_ - packet_steps_;
                    if (saved < most_saved - most_lost_steps) {
                        split(child, &top.distance() - stack_.distances);
                        return Walk::end;
                    }
                    most_saved = saved > most_saved ? saved : most_saved;
                    if (rays == 0) return Walk::skip;
                }
                for (int i = 0; i < node_width; ++i) parent_at(top)[i] = child;
                return Walk::visit;
            },
            [&](std::uint32_t child, const Stack::Top& top) {
                unsigned rays = rays_meeting_box(*parent_at(top), child);
                count_step(__builtin_popcount(rays), leaf_cost);
                const Block* block = bvh_.template leaf<Layout>(child);
                bool found = false;
                for (std::uint32_t count = leaf_block_count(child); rays != 0 && count > 0;
                     --count, block = block->next())
                    found |= test_block(*block, rays);
                if (found) box_tmax = farthest_tmax();
                return box_tmax == finished ? Walk::end : Walk::visit;
            });
    }

    [[gnu::always_inline]] void count_step(int rays, int cost) {
        packet_steps_ += cost;
        single_steps_ += rays;
    }

    // Keeps what is left to do: `child`, whose place on the stack is `top`, and the entries below it.
    [[gnu::noinline]] void split(std::uint32_t child, std::ptrdiff_t top) {
        for (std::ptrdiff_t i = Stack::sentinels; i <= top; ++i) {
            Entry& entry = entries_[entry_count_];
            entry.child = i == top ? child : stack_.children[i];
            entry.rays = rays_meeting_box(parents_[i], entry.child, entry.tnear);
            entry_count_ += entry.rays != 0;
            split_rays_ |= entry.rays;
        }
        packet_steps_ += split_cost + entry_cost * static_cast<int>(entry_count_);
    }

    // The mask of the rays that meet the box of a node's child, and where they enter it.
    [[gnu::always_inline]] unsigned rays_meeting_box(std::uint32_t parent, std::uint32_t of_child,
                                                     float* tnear = nullptr) const {
        const Node& node = bvh_.template node<Layout>(parent);
        const unsigned lane = I::Hits::of_child(node.child, of_child).first();
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
            if (tnear) boxes.tnear.store(tnear + i);
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
    std::size_t first_ = 0;  // ray of the packet
    int packet_steps_ = 0, single_steps_ = 0;
    unsigned split_rays_ = 0;  // mask of rays not yet taken
    std::size_t entry_count_ = 0;
    Frame ray_[packet_size];
    Query query_[packet_size];
    Candidate candidates_[packet_size + 1];
    Stack stack_;
    std::uint32_t parents_[Stack::size];
    Entry entries_[Stack::size];
};

// Decides which rays of a thread are traced in packets.
template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query>
class Packets {
    using OnePacket = Packet<I, Slabs, Triangles, Query>;

public:
    static constexpr bool bit_exact = OnePacket::bit_exact;

    // None if fewer rays are in flight than a packet has.
    Packets(const BvhView& bvh, const auto& rays, const auto& hits, unsigned in_flight) : packet_(bvh, rays, hits) {
        if (in_flight < OnePacket::packet_size) pauses_.never();
    }

    // Traces the rays from `next` on as a packet if there are enough and they are coherent; returns true then, with
    // `next` moved past them, or to the end if the packet was split: its rays come before all others. After a packet
    // that was refused or not worthwhile, more and more rays are skipped before the next attempt.
    [[gnu::always_inline]] bool trace_next(std::size_t& next, std::size_t end) {
        if (!pauses_.allow(next) || end - next < OnePacket::packet_size) return false;
        const auto outcome = packet_.trace(next);
        const bool traced = outcome != OnePacket::Outcome::refused;
        if (traced) next += OnePacket::packet_size;
        if (outcome == OnePacket::Outcome::worthwhile)
            pauses_.worthwhile();
        else
            pauses_.in_vain(next);
        if (packet_.has_split_rays()) {
            after_split_ = next;
            next = end;
        }
        return traced;
    }

    bool has_split_rays() const { return packet_.has_split_rays(); }
    // Moves a ray of the split packet to a flight; after the last one `next` is the ray behind the packet again.
    void take_split_ray(auto& flight, std::size_t& next) {
        packet_.take_split_ray(flight);
        if (!packet_.has_split_rays()) next = after_split_;
    }

private:
    // Until a packet was worthwhile: what the tries of a batch of few rays lose would be a large part of its time.
    static constexpr std::size_t first_pause = 112;

    Pauses pauses_{0, first_pause};
    std::size_t after_split_ = 0;
    OnePacket packet_;
};

struct NoPackets {
    [[gnu::always_inline]] NoPackets(const BvhView&, const auto&, const auto&, unsigned) {}
    [[gnu::always_inline]] static bool trace_next(std::size_t, std::size_t) { return false; }
    static constexpr bool has_split_rays() { return false; }
    static void take_split_ray(auto&, std::size_t&) {}
};

}  // namespace wive::WIVE_ISA
