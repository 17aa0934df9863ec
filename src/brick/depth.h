#pragma once

#include <algorithm>
#include <compare>
#include <tuple>

#include "tessera/vec.h"

namespace tessera {

/// How many times a brick's spacing was halved from that of the coarsest bricks, which have depth 0. A level
/// counts the other way, up from the finest; the two don't convert into each other by themselves.
class Depth {
  public:
    constexpr Depth() = default;
    constexpr explicit Depth(int halvings) : halvings_(halvings) {}
    constexpr int halvings() const { return halvings_; }

    friend constexpr auto operator<=>(const Depth&, const Depth&) = default;
    friend constexpr Depth operator+(Depth depth, int halvings) { return Depth(depth.halvings_ + halvings); }
    friend constexpr Depth operator-(Depth depth, int halvings) { return Depth(depth.halvings_ - halvings); }
    friend constexpr int operator-(Depth a, Depth b) { return a.halvings_ - b.halvings_; }

  private:
    int halvings_ = 0;
};

/// The level of bricks of a depth, where those of depth `finest` have level 0.
constexpr int levelOf(Depth depth, Depth finest) {
    return finest - depth;
}

/// A brick by its depth. It is the union of the eight bricks (depth + 1, 2 index + {0, 1}), its children.
struct DepthKey {
    Depth depth;
    Vec3i index{0};
    friend bool operator==(const DepthKey&, const DepthKey&) = default;
};

/// Ascending by depth, z, y, x.
inline bool inStorageOrder(const DepthKey& a, const DepthKey& b) {
    return std::tie(a.depth, a.index.z, a.index.y, a.index.x) <
           std::tie(b.depth, b.index.z, b.index.y, b.index.x);
}

/// Which child of its parent a brick is: (x & 1) | (y & 1) << 1 | (z & 1) << 2.
inline unsigned childNumber(const Vec3i& index) {
    return unsigned((index.x & 1) | (index.y & 1) << 1 | (index.z & 1) << 2);
}

/// Where a child lies in its parent: 0 or 1 on every axis.
inline Vec3i childOffset(unsigned child) {
    return {child & 1, (child >> 1) & 1, child >> 2};
}

inline DepthKey childKey(const DepthKey& parent, unsigned child) {
    return {parent.depth + 1, parent.index * 2 + childOffset(child)};
}

/// The brick of a depth, at most the key's own, that contains a brick.
inline DepthKey ancestorKey(const DepthKey& key, Depth depth) {
    // Arithmetic shifts round towards minus infinity, as floor division by a power of two does.
    const int shift = std::min(key.depth - depth, 31);
    return {depth, {key.index.x >> shift, key.index.y >> shift, key.index.z >> shift}};
}

}  // namespace tessera
