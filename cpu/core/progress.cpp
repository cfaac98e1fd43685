#include "core/progress.h"

#include <algorithm>

namespace wive {

double progress() {
    double done = 0;
    for (const ProgressPart* part = ProgressPart::innermost; part; part = part->outer_) {
        if (part->next_) {
            if (part != ProgressPart::innermost) continue;
            const std::size_t taken = std::min(__atomic_load_n(part->next_, __ATOMIC_RELAXED), part->count_);
            done = static_cast<double>(taken) / static_cast<double>(std::max<std::size_t>(part->count_, 1));
        } else {
            done = part->begin_ + part->size_ * done;
        }
    }
    return done;
}

}  // namespace wive
