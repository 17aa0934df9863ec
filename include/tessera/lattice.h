#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tessera/vec.h"

namespace tessera {

/// A frame of sample points: lattice point (i, j, k) is the real number origin + i u + j v + k w, never its
/// rounding. Bricks use axis-parallel frames with one spacing; a cut plane is a frame of any orientation used
/// with one layer.
struct Lattice {
    Vec3d originWorld{0};
    Vec3d uWorld{1, 0, 0};
    Vec3d vWorld{0, 1, 0};
    Vec3d wWorld{0, 0, 1};

    static Lattice axisParallel(const Vec3d& originWorld, double spacingWorld) {
        return {originWorld, {spacingWorld, 0, 0}, {0, spacingWorld, 0}, {0, 0, spacingWorld}};
    }
    /// u, v and w lie along x, y and z, each with a positive length.
    bool isAxisParallel() const;
    /// Rounded world place of a lattice point.
    Vec3d worldFromIndex(const Vec3d& index) const {
        return originWorld + index.x * uWorld + index.y * vWorld + index.z * wWorld;
    }
    friend bool operator==(const Lattice&, const Lattice&) = default;
};

/// Box of lattice points, half-open: min <= index < max on every axis.
struct IndexBox {
    Vec3i min{0};
    Vec3i max{0};

    bool empty() const { return max.x <= min.x || max.y <= min.y || max.z <= min.z; }
    Vec3i size() const { return max - min; }
    /// Number of lattice points.
    std::int64_t count() const {
        return empty() ? 0 : std::int64_t(max.x - min.x) * (max.y - min.y) * (max.z - min.z);
    }
    bool contains(const Vec3i& p) const {
        return p.x >= min.x && p.y >= min.y && p.z >= min.z && p.x < max.x && p.y < max.y && p.z < max.z;
    }
    friend bool operator==(const IndexBox&, const IndexBox&) = default;
};

inline IndexBox intersect(const IndexBox& a, const IndexBox& b) {
    return {glm::max(a.min, b.min), glm::min(a.max, b.max)};
}

/// Dense samples of one box of lattice points. Point (i, j, k) of the box has offset ((k - min.z) * ny + (j -
/// min.y)) * nx + (i - min.x).
struct Block {
    Lattice lattice;
    IndexBox box;
    /// One for every component of every chosen field.
    int channels = 0;
    /// channels x box.count(), channel by channel; meaningful where covered.
    std::vector<float> values;
    /// box.count(): 1 where the point lies in the mesh, else 0.
    std::vector<std::uint8_t> coverage;

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
