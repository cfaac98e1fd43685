// The closest point of the surface: a traversal that visits the nearest child first and leaves out the boxes that are
// farther away than the best triangle so far. What is found does not depend on the order of visits: of all triangles it
// is the one at the least distance, as TriangleDistance computes it, and of several the one with the lowest prim.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "core/closest.h"
#include "core/ray.h"
#include "traverse/point_boxes.h"
#include "traverse/stack.h"
#include "traverse/traversal.h"

namespace wive::WIVE_ISA {

template <class V>
[[gnu::always_inline]] inline V magnitude(V x) {
    return abs(x);
}

// Functions of one double, or of several in a vector.
template <class V>
struct NumbersOf {
    [[gnu::always_inline]] static V of(double x) { return V::all(x); }
    [[gnu::always_inline]] static V larger(V a, V b) { return max(a, b); }
    [[gnu::always_inline]] static V smaller(V a, V b) { return min(a, b); }
    [[gnu::always_inline]] static V abs(V x) { return magnitude(x); }
};
template <>
struct NumbersOf<double> {
    static double of(double x) { return x; }
    static double larger(double a, double b) { return a > b ? a : b; }
    static double smaller(double a, double b) { return a < b ? a : b; }
    static double abs(double x) { return __builtin_fabs(x); }
};

template <class V>
struct DistancesOf {
    using Number = V;
    using Numbers = NumbersOf<V>;
    // clang-format off
#include "core/double3.inc"
#include "core/triangle_distance.inc"
    // clang-format on
};

// The order of children that leaves them in their slots.
alignas(32) inline constexpr std::uint32_t order_by_slot[node_width] = {0, 1, 2, 3, 4, 5, 6, 7};

// edges: the tree is a `fast` one, which has rounded edges in place of second and third corners.
template <Isa I, NodeLayout<I> L, bool edges>
class ClosestPoint {
public:
    using Layout = L;
    using Real = typename I::Real;
    using Block = typename Layout::Block;

    // False if the point is NaN or out of range: no triangle is close to it then.
    [[gnu::always_inline]] bool start(const BvhView& bvh, const PointBatch<Real>& batch, std::size_t i) {
        const Real* p = batch.points + 3 * i;
        const Real4 position = Real4::set(p[0], p[1], p[2], 0);
        if (less_equal(abs(position), Real4::all(max_coordinate<Real>)) != 15u) return false;
        for (int axis = 0; axis < 3; ++axis) point_[axis] = p[axis];
        most_ = batch.max_distance[i * batch.max_distance_stride];
        prim_ = no_prim;
        // Distances are compared with the limit once rounded, when all is done: until then the limit is a bit larger.
        const double most = (static_cast<double>(most_) + std::numeric_limits<Real>::denorm_min()) *
                            (1 + 4 * static_cast<double>(std::numeric_limits<Real>::epsilon()));
        best_ = most * most;
        boxes_.load(bvh, point_);
        limit_ = boxes_.limit(best_);
        if (block_ != nullptr) test(*block_);  // where the last point was close to: a bound, if not the answer
        top_ = Stack::Top(stack_);
        top_.move(-1);
        child_ = inner_child(0);
        return true;
    }

    // Visits a node or a leaf, and finds the next. True once there is none.
    [[gnu::always_inline]] bool step(const BvhView& bvh) {
        if (is_inner(child_)) {
            if (visit(bvh.node<Layout>(child_))) {
                prefetch<Layout>(bvh, child_);
                return false;
            }
        } else {
            const Block* block = bvh.leaf<Layout>(child_);
            for (std::uint32_t blocks = leaf_block_count(child_);;) {
                test(*block);
                if (--blocks == 0) break;
                block = block->next();
            }
        }
        while (top_.distance() > limit_) top_.move(-1);
        child_ = top_.child();
        if (child_ == end_of_stack) return true;
        top_.move(-1);
        prefetch<Layout>(bvh, child_);
        return false;
    }

    [[gnu::always_inline]] void write(const ClosestBatch<Real>& out, std::size_t i) const {
        const Real distance = static_cast<Real>(std::sqrt(best_));
        const bool found = prim_ != no_prim && distance <= most_;
        out.distance[i] = found ? distance : std::numeric_limits<Real>::infinity();
        out.prim[i] = static_cast<std::int32_t>(found ? prim_ : no_prim);
        double uv[2] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
        if (found) weights(uv);
        for (std::size_t k = 0; k < 2; ++k) out.uv[2 * i + k] = static_cast<Real>(uv[k]);
    }
    static void write_none(const ClosestBatch<Real>& out, std::size_t i) {
        constexpr Real nan = std::numeric_limits<Real>::quiet_NaN();
        out.distance[i] = std::numeric_limits<Real>::infinity();
        out.prim[i] = static_cast<std::int32_t>(no_prim);
        out.uv[2 * i] = out.uv[2 * i + 1] = nan;
    }

    std::size_t index = 0;  // of the point in its batch

private:
    using Real4 = typename I::Real4;
    using Float8 = typename I::Float8;
    using Double4 = typename I::Double4;
    using Corners = typename Layout::template Corners<I>;
    using Distances = DistancesOf<Double4>;
    using Distance = DistancesOf<double>;

    // Sets the nearest child as the next, and stores the others that are near enough. False if none is.
    [[gnu::always_inline]] bool visit(const typename Layout::Node& node) {
        const auto [squared, near] = boxes_.test(node, limit_);
        if (near.bits() == 0) return false;
        const float least = -highest_lane(squared * Float8::all(-1));
        // A lane without a child may have the least distance in a compressed node: any child will do then.
        const unsigned nearest = hits(squared, Float8::all(least)).bits() & near.bits();
        child_ = node.child[nearest != 0 ? static_cast<unsigned>(__builtin_ctz(nearest)) : near.first()];
        const auto others = near.without(I::Hits::of_child(node.child, child_));
        Stack::Top above = top_;
        above.move(1);
        const typename I::Order order(order_by_slot, 0);
        typename I::template Lanes<true>(order, others, squared, node.child).compress_to(above);
        top_.move(static_cast<std::ptrdiff_t>(others.count()));
        return true;
    }

    [[gnu::always_inline]] static Double4 in_doubles(Real4 x) {
        if constexpr (std::is_same_v<Real, double>)
            return x;
        else
            return widen(x);
    }
    [[gnu::always_inline]] static void load(const Corners& corners, typename Distances::Double3 (&v)[3]) {
        for (std::size_t k = 0; k < 3; ++k) {
            Double4 axes[3];
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const Real4 v0 = corners.vertex(0, axis);
                if constexpr (edges)
                    axes[axis] = k == 0 ? in_doubles(v0) : in_doubles(v0) + in_doubles(corners.edge(k, axis, v0));
                else
                    axes[axis] = in_doubles(corners.vertex(k, axis));
            }
            v[k] = {axes[0], axes[1], axes[2]};
        }
    }

    [[gnu::always_inline]] void test(const Block& block) {
        const Corners corners(block);
        typename Distances::Double3 v[3];
        load(corners, v);
        typename Distances::TriangleDistance distance;
        distance.measure(v[0], v[1], v[2], {Double4::all(point_[0]), Double4::all(point_[1]), Double4::all(point_[2])});
        const Double4 squared = distance.squared();
        unsigned lanes = corners.used(less_equal(squared, Double4::all(best_)));
        if (lanes == 0) return;
        alignas(sizeof(Double4)) double each[block_width];
        squared.store(each);
        for (; lanes != 0; lanes &= lanes - 1) {
            const int lane = __builtin_ctz(lanes);
            const auto prim = static_cast<std::uint32_t>(block.prim_at(lane));
            if (!(each[lane] < best_ || (each[lane] == best_ && prim < prim_))) continue;
            best_ = each[lane];
            prim_ = prim;
            block_ = &block;
            lane_ = lane;
        }
        limit_ = boxes_.limit(best_);
    }

    void weights(double* uv) const {
        typename Distances::Double3 v[3];
        load(Corners(*block_), v);
        typename Distance::Double3 corner[3];
        for (int k = 0; k < 3; ++k) {
            alignas(sizeof(Double4)) double x[block_width], y[block_width], z[block_width];
            v[k].x.store(x);
            v[k].y.store(y);
            v[k].z.store(z);
            corner[k] = {x[lane_], y[lane_], z[lane_]};
        }
        typename Distance::TriangleDistance distance;
        distance.measure(corner[0], corner[1], corner[2], {point_[0], point_[1], point_[2]});
        distance.weights(uv);
    }

    PointBoxes<I, Layout> boxes_;
    double point_[3], best_;  // the least squared distance so far
    float limit_;             // the same for boxes
    Real most_;
    std::uint32_t child_, prim_;
    int lane_ = 0;
    const Block* block_ = nullptr;  // where prim_ is; before the first triangle of a point, where the last one was
    Stack::Top top_;
    Stack stack_;
};

// A kernel: the closest points for the points of a source, several of them in turns, so that a core works on one while
// it waits for the memory of another.
template <class I, class Layout, bool edges>
void find_closest(const BvhView& bvh, const PointBatch<typename I::Real>& points,
                  const ClosestBatch<typename I::Real>& out, const RaySource& source) {
    static_assert(Isa<I>, "I lacks an operation of an instruction set, see Isa in traverse/concepts.h");
    static_assert(NodeLayout<Layout, I>, "Layout must be a NodeLayout, see traverse/concepts.h");
    // Measured on eight scenes of 0.14 to 0.8 million triangles: up to 2.7 times as fast as one at a time if points are
    // random, at most a fifth slower on regular grids, whose neighbours have the better bounds.
    constexpr std::size_t in_flight = 8;
    using Flight = ClosestPoint<I, Layout, edges>;
    Flight flights[in_flight];
    std::size_t next = 0, end = 0;
    const auto start_next = [&](Flight& flight) {
        for (;; ++next) {
            if (next == end && !source.take(next, end)) {
                next = end;
                return false;
            }
            flight.index = next;
            if (flight.start(bvh, points, next)) break;
            Flight::write_none(out, next);
        }
        ++next;
        return true;
    };
    std::size_t count = 0;
    while (count < in_flight && start_next(flights[count])) ++count;
    Flight* active[in_flight];
    for (std::size_t i = 0; i < count; ++i) active[i] = flights + i;
    while (count > 0)
        for (std::size_t i = 0; i < count; ++i) {
            Flight& flight = *active[i];
            if (!flight.step(bvh)) continue;
            flight.write(out, flight.index);
            if (!start_next(flight)) active[i--] = active[--count];
        }
}

}  // namespace wive::WIVE_ISA
