// Which distances from a tree are large.
#pragma once

#include <array>
#include <cstddef>

#include "build/mesh.h"

namespace wive {

// The distance from which the slack of the boxes (frame.h) is a fourth of a typical triangle's size:
// BvhView::far_away.
template <class Real>
float far_away_from(const Mesh<Real>& mesh);

// What is far from a float32 scene: origins that differ from its middle by more than `far` on some axis, whose rays
// float32 moves by too much. They are brought nearer before they are traced (wive/_internal/distant.py).
struct Distant {
    std::array<double, 3> center;
    double far;

    // Whether some origin (n, 3) may be far. True if one is; it may also be true if none is, because all axes are
    // compared with one range.
    template <class Real>
    bool may_hold(const Real* origins, std::size_t count) const;
};

// far_away: what far_away_from says of the mesh. Nothing is far from a scene without bounds.
Distant distant_from(const Bounds& bounds, float far_away);

}  // namespace wive
