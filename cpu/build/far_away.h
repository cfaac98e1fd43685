// From where a tree is seen from far away: BvhView::far_away.
#pragma once

#include "build/mesh.h"

namespace wive {

// The distance from which the slack of the boxes (frame.h) is a fourth of a typical triangle's size.
template <class Real>
float far_away_from(const Mesh<Real>& mesh);

}  // namespace wive
