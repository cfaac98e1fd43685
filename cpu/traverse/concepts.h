// What the template arguments of the traversal must provide: one concept per parameter, one contract per operation.
//
// Lane 0 comes first. A hit mask has one bit per lane, lane 0 lowest. Comparisons with NaN are false. Floating-point
// operations are per lane, each rounded on its own, so that every instruction set gives the same bits.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

#include "core/interval.h"
#include "core/layout.h"
#include "core/ray.h"
#include "traverse/stack.h"

namespace wive::WIVE_ISA {

template <class I>
struct BoxHits;  // slabs.h
template <class Float8>
struct AllChildren;  // slabs.h
struct OctantRows;   // slabs.h

// Four numbers: one vector of x, y and z, or one value for each triangle of a block.
template <class V, class Number>
concept FourLanes = requires(V a, V b, const Number* from, Number* to, Number x) {
    { V::load(from) } -> std::same_as<V>;                          // from memory aligned to the vector's size
    { V::set(x, x, x, x) } -> std::same_as<V>;                     // one number per lane
    { V::all(x) } -> std::same_as<V>;                              // the same number in every lane
    a.store(to);                                                   // to memory aligned to the vector's size
    { a + b } -> std::same_as<V>;                                  // sum
    { a - b } -> std::same_as<V>;                                  // difference
    { a * b } -> std::same_as<V>;                                  // product, never fused with a sum
    { a / b } -> std::same_as<V>;                                  // quotient
    { min(a, b) } -> std::same_as<V>;                              // a < b ? a : b, hence b if either is NaN
    { max(a, b) } -> std::same_as<V>;                              // a > b ? a : b, hence b if either is NaN
    { abs(a) } -> std::same_as<V>;                                 // a with its sign bit cleared
    { flip_sign(a, b) } -> std::same_as<V>;                        // a, negated if b has its sign bit set
    { highest_lane(a) } -> std::same_as<Number>;                   // the largest lane, if none is NaN
    { less_equal(a, b) } -> std::same_as<unsigned>;                // mask of a <= b
    { equal(a, b) } -> std::same_as<unsigned>;                     // mask of a == b
    { all_in_order(a, b, a, b, a, b) } -> std::same_as<unsigned>;  // mask of 1st <= 2nd, 3rd <= 4th and 5th < 6th
    { one_sided(a, b) } -> std::same_as<unsigned>;                 // mask of a >= 0 or b <= 0
};

// Four floats, with what only floats need.
template <class F, class Double4>
concept FourFloats = FourLanes<F, float> && requires(F a, F b, Double4 d) {
    { less(a, b) } -> std::same_as<unsigned>;    // mask of a < b
    { sign_bits(a) } -> std::same_as<unsigned>;  // mask of the lanes whose sign bit is set
    { widen(a) } -> std::same_as<Double4>;       // the same values as doubles
    { F::narrow(d) } -> std::same_as<F>;         // rounded to the nearest floats
    { F::narrow(a) } -> std::same_as<F>;         // a itself, for code that is written for either precision
};

// Which of a node's eight lanes were hit.
template <class H>
concept HitLanes = requires(const H hits, const std::uint32_t* row, std::uint32_t child) {
    { hits.bits() } -> std::same_as<unsigned>;       // the hit mask
    { hits.count() } -> std::same_as<unsigned>;      // the number of lanes hit
    { hits.first() } -> std::same_as<unsigned>;      // the lowest lane hit; at least one must be
    { hits.last() } -> std::same_as<unsigned>;       // the highest lane hit; at least one must be
    { H::of_child(row, child) } -> std::same_as<H>;  // the lanes of a node's child row that hold this child
    { hits.without(hits) } -> std::same_as<H>;       // the lanes that are hit here but not there
};

// Eight floats: one per child of a node, or one per ray of half a packet.
template <class V, class Hits>
concept EightFloats = requires(V a, V b, V c, const float* from, float* to, const std::uint8_t* bytes, float x) {
    { V::load(from) } -> std::same_as<V>;          // from memory aligned to 32 bytes
    { V::load(bytes) } -> std::same_as<V>;         // eight bytes as floats
    a.store(to);                                   // to memory aligned to 32 bytes
    { V::all(x) } -> std::same_as<V>;              // the same number in every lane
    { a * b } -> std::same_as<V>;                  // product
    { multiply_add(a, b, c) } -> std::same_as<V>;  // a * b + c, fused or not: the slack in frame.h allows for either
    { min(a, b) } -> std::same_as<V>;              // as for four lanes
    { max(a, b) } -> std::same_as<V>;              // as for four lanes
    { highest_lane(a) } -> std::same_as<float>;    // the largest lane, if none is NaN
    { hits(a, b) } -> std::same_as<Hits>;          // the lanes in which a <= b
};

// Steps (C) and (D) for one node: children and, if in_order, distances on their way to the stack.
template <class L, class I>
concept CompressedChildren =
    // Permutes the lanes by the order if in_order; else they stay in slot order.
    std::constructible_from<L, typename I::Order, typename I::Hits, typename I::Float8, const std::uint32_t*> &&
    requires(const L lanes, Stack::Top top) {
        lanes.compress_to(top);                               // stores the lanes that were hit, from top upwards
        { lanes.last_hit() } -> std::same_as<std::uint32_t>;  // the child in the last lane hit; at least one must be
    };

// An instruction set.
template <class I>
concept Isa =
    // Real: the numbers of the scene's triangles and rays. Boxes are always intersected in float.
    (std::same_as<typename I::Real, float> || std::same_as<typename I::Real, double>) &&
    FourLanes<typename I::Real4, typename I::Real> && FourLanes<typename I::Double4, double> &&
    FourFloats<typename I::Float4, typename I::Double4> && HitLanes<typename I::Hits> &&
    EightFloats<typename I::Float8, typename I::Hits> &&
    requires(typename I::Float4 a) {
        { I::Real4::of(a) } -> std::same_as<typename I::Real4>;  // the same values in the scene's precision
    } &&
    // The slots of a node in the order of one octant: from the node's order row, and a shift of it in bits.
    std::constructible_from<typename I::Order, const std::uint32_t*, unsigned> &&
    std::constructible_from<typename I::Order, const std::uint8_t (*)[3], unsigned> &&
    // Four of the eight floats at an address, which need not be aligned, chosen by four bits each of a word.
    std::constructible_from<typename I::Pick, std::uint32_t, int> &&
    requires(const typename I::Pick pick, const float* row) {
        { pick(row) } -> std::same_as<typename I::Float4>;
    } && CompressedChildren<typename I::template Lanes<true>, I> &&
    CompressedChildren<typename I::template Lanes<false>, I>;

// How nodes and triangle blocks are stored, and what follows from it for the slab test.
template <class L, class I>
concept NodeLayout = requires(const typename L::Node& node, const AllChildren<typename I::Float8>& children,
                              std::size_t row, unsigned axis, typename I::Float8 x, BoxHits<I> hits) {
    typename L::Block;                                         // up to four triangles
    typename L::template Corners<I>;                           // their corners as vectors (corners.h)
    { L::prefetched_lines } -> std::convertible_to<unsigned>;  // cache lines of a node or of most blocks
    { L::order_bits } -> std::convertible_to<unsigned>;        // bits per octant in a lane of the order row
    { L::boxes_are_nested } -> std::convertible_to<bool>;      // every box lies within its parent's box
    // Distances along a ray to the planes in a row of the node, given the ray's reciprocal and bias on that axis.
    { L::distance(node, children, row, axis, x, x) } -> std::same_as<typename I::Float8>;
    { L::drop_empty_lanes(node, hits) } -> std::same_as<BoxHits<I>>;  // without the lanes that have no child
};

// The slab test of one ray or packet, steps (A) and (B).
template <class S, class I>
concept SlabTest =
    NodeLayout<typename S::Layout, I> && requires(const S slabs, const typename S::Node& node, float tmax) {
        // The slots in the order of the ray's octant, farthest first.
        { slabs.order(node) } -> std::same_as<typename I::Order>;
        // The boxes that the ray meets in its interval up to tmax, and where it enters each, by slot.
        { slabs.test(node, tmax) } -> std::same_as<BoxHits<I>>;
    };

// What is kept of the hits of one ray.
template <class Q, class Real>
concept RayQuery = std::same_as<decltype(Q::interval), Interval<Real>> &&  // in which hits still count
                   requires(const Q query, const HitBatch<Real>& hits, std::size_t i, Real unscale) {
                       typename Q::InFlight;  // the variant of the query for rays in flight
                       // Whether children are visited front to back, because the interval shrinks with every hit.
                       { Q::in_order } -> std::convertible_to<bool>;
                       // Whether it uses u and v of the hits that it is offered.
                       { Q::wants_uv } -> std::convertible_to<bool>;
                       // Whether hits are crossings: a ray through an edge or a vertex of a closed surface hits it as
                       // often as a ray beside it. Otherwise triangles are closed. `fast` ignores it.
                       { query.crossings } -> std::convertible_to<bool>;
                       query.write(hits, i, unscale);  // writes the result of ray i; unscale: see RayFrame
                   };

// A query that wants only the number of hits in its interval.
template <class Q>
concept CountingQuery = requires(Q query, unsigned hits) {
    { query.take(hits) } -> std::same_as<bool>;  // takes the number of hits in a block; true once the query is done
};

// A query that checks itself whether a hit lies in the interval; prim is that of the triangle.
template <class Q, class Real>
concept OfferedQuery = RayQuery<Q, Real> && (CountingQuery<Q> || requires(Q query, Real x, std::uint32_t prim) {
                           { query.offer(x, x, x, prim) } -> std::same_as<bool>;  // takes t, u and v; true: done
                       });

// The test of a ray against a block of four triangles.
template <class T, class Corners, class Query>
concept TriangleTest = std::constructible_from<T, const typename T::Frame&> &&
                       requires(const T test, typename T::Frame frame, const typename T::Found found,
                                const Corners& corners, Query& query) {
                           // Whether no hit lies outside the box of its leaf by more than the slack of frame.h.
                           { T::hits_are_in_boxes } -> std::convertible_to<bool>;
                           // The lanes that may be hit, none of those hit missing, and what solve() reuses.
                           { test.find(corners) } -> std::same_as<typename T::Found>;
                           { found.hit_mask } -> std::convertible_to<unsigned>;
                           // Offers the hits in those lanes to the query; true once the query is done.
                           { test.solve(corners, found, query) } -> std::same_as<bool>;
                       };

// Counters of a ray's steps.
template <class C>
concept StepCounter = requires(C counters, const C written, const TriangleBlock& block, const HitBatch<float>& hits) {
    counters.inner_node();    // an inner node was visited
    counters.leaf();          // a leaf was left
    counters.block(block);    // a block of triangles was tested
    written.write(hits, 0u);  // writes the counts of a ray
};

// Everything that a kernel is compiled from fits together.
template <class I, template <class> class Slabs, template <class> class Triangles, class Query>
concept Traversable =
    Isa<I> && SlabTest<Slabs<I>, I> && std::constructible_from<Slabs<I>, const typename Triangles<I>::Frame&> &&
    std::constructible_from<Slabs<I>, const typename Triangles<I>::Frame&, const OctantRows&> &&
    RayQuery<Query, typename I::Real> &&
    TriangleTest<Triangles<I>, typename Slabs<I>::Layout::template Corners<I>, Query>;

}  // namespace wive::WIVE_ISA
