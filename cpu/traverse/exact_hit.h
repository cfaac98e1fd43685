// The exact arithmetic that triangle_exact.h falls back on when floating point leaves a doubt. Slow, rarely needed, and
// compiled once for all instruction sets.
#pragma once

namespace wive {

// A ray as the caller gave it: t is in multiples of the length of this direction.
struct CallerRay {
    float origin[3], direction[3];
};

struct TriangleCorners {
    float v[9];  // three times x, y, z
};

// t, u and v of a hit, each the float nearest to the exact value; a negative t that rounds to zero is -0.
struct RoundedHit {
    float t, u, v;
};

// Whether the ray's line hits the closed triangle; fills in `hit` if it does. With crossings, a line that meets an
// edge or a vertex of a closed surface hits it exactly as often as a line beside it does (docs/accuracy.md).
bool hits_exactly(const CallerRay& ray, const TriangleCorners& corners, bool crossings, RoundedHit& hit);

// The sign of the difference between the t of two triangles that the line hits.
int compare_distances(const CallerRay& ray, const TriangleCorners& one, const TriangleCorners& other);

}  // namespace wive
