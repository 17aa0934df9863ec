#pragma once

#include <algorithm>
#include <cstddef>

#include "tessera/lattice.h"

namespace tessera {

/// Copies the values and the coverage of a box of lattice points from one block to another. Both hold the box
/// and have as many channels.
inline void copyPoints(const Block& from, const IndexBox& box, Block& to) {
    const int length = box.size().x;
    Vec3i p = box.min;
    for (p.z = box.min.z; p.z < box.max.z; ++p.z)
        for (p.y = box.min.y; p.y < box.max.y; ++p.y) {
            const std::size_t source = from.offset(p), target = to.offset(p);
            std::copy_n(from.coverage.data() + source, length, to.coverage.data() + target);
            for (int c = 0; c < from.channels; ++c)
                std::copy_n(from.channel(c).data() + source, length,
                            to.values.data() + std::size_t(c) * to.count() + target);
        }
}

}  // namespace tessera
