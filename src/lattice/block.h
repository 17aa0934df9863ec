#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lattice/lattice.h"

namespace tessera {

/// Dense samples of one box of lattice points. Point (i, j, k) of the box has offset ((k - min.z) * ny + (j -
/// min.y)) * nx + (i - min.x).
struct Block {
    Lattice lattice;
    IndexBox box;
    int channels = 0;           ///< one for every component of every chosen field
    std::vector<float> values;  ///< channels x box.count(), channel by channel; meaningful where covered
    std::vector<std::uint8_t> coverage;  ///< box.count(): 1 where the point lies in the mesh, else 0

    std::size_t count() const { return std::size_t(box.count()); }
    std::size_t offset(const Vec3i& p) const {
        const Vec3i n = box.size();
        const Vec3i q = p - box.min;
        return (std::size_t(q.z) * std::size_t(n.y) + std::size_t(q.y)) * std::size_t(n.x) + std::size_t(q.x);
    }
    bool covered(const Vec3i& p) const { return coverage[offset(p)] != 0; }
    /// A covered point whose value isn't finite is not valid for that channel.
    float value(int channel, const Vec3i& p) const {
        return values[std::size_t(channel) * count() + offset(p)];
    }
    std::span<const float> channel(int c) const {
        return {values.data() + std::size_t(c) * count(), count()};
    }
};

}  // namespace tessera
