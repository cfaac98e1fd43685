// The exact answers that triangle_exact.h asks for where floating point is in doubt. Slow, rarely needed, and compiled
// once for every instruction set.
#pragma once

namespace wive {

// As the caller gave it: t counts in lengths of this direction.
struct GivenRay {
    float origin[3], direction[3];
};

struct Corners {
    float v[9];  // three times x, y, z
};

// Of a hit, each the float nearest to the exact value.
struct HitNumbers {
    float t, u, v;
};

// Whether the ray's line hits the closed triangle or, with perturb_edges, whether it passes through it by the rule that
// lets it pass a closed surface at an edge or a vertex exactly as often as beside it (docs/accuracy.md).
bool hits_exactly(const GivenRay& ray, const Corners& corners, bool perturb_edges, HitNumbers& numbers);

// The sign of t - limit for a triangle that the line meets.
int compare_with_limit(const GivenRay& ray, const Corners& corners, float limit);

// The sign of the difference of the t of two triangles that the line meets.
int compare_distances(const GivenRay& ray, const Corners& one, const Corners& other);

}  // namespace wive
