#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "base/check.h"
#include "brick/depth.h"
#include "tessera/vec.h"

namespace tessera {

struct IndexHash {
    std::size_t operator()(const Vec3i& index) const {
        // Multiplicative mixing; the last shift brings the high bits down to where tables look.
        std::uint64_t h = 0x9e3779b97f4a7c15ull;
        for (const int v : {index.x, index.y, index.z})
            h = (h ^ std::uint64_t(std::uint32_t(v))) * 0x9fb21c651e98df25ull, h ^= h >> 29;
        return std::size_t(h ^ (h >> 32));
    }
};

struct DepthKeyHash {
    std::size_t operator()(const DepthKey& key) const {
        return IndexHash{}(key.index) * 31 + std::size_t(key.depth.halvings());
    }
};

/// One value for each of some bricks of one size, found by the brick's index: a dense grid over their box, or
/// a map when that would be mostly empty. Other bricks have the value Value{}.
template <class Value>
class RootGrid {
  public:
    RootGrid() = default;
    explicit RootGrid(std::span<const Vec3i> indices) {
        if (indices.empty()) return;
        Vec3i last = min_ = indices.front();
        for (const Vec3i& index : indices) min_ = glm::min(min_, index), last = glm::max(last, index);
        const Vec3d cells = Vec3d(last) - Vec3d(min_) + 1.0;
        const double count = cells.x * cells.y * cells.z;
        if (count <= std::max(65536.0, 16.0 * double(indices.size()))) {
            size_ = last - min_ + 1;
            dense_.resize(std::size_t(count));
        } else {
            for (const Vec3i& index : indices) sparse_.try_emplace(index);
        }
    }

    Value at(const Vec3i& index) const {
        if (const Value* value = find(index)) return *value;
        return Value{};
    }
    /// Of a brick that the grid was made with. Throws InternalError for others.
    Value& slot(const Vec3i& index) {
        const Value* value = find(index);
        TESSERA_CHECK(value, "no brick of the grid");
        return const_cast<Value&>(*value);
    }

  private:
    const Value* find(const Vec3i& index) const {
        if (dense_.empty()) {
            const auto found = sparse_.find(index);
            return found == sparse_.end() ? nullptr : &found->second;
        }
        // Unsigned comparison rejects what lies below the grid too.
        const std::uint32_t x = std::uint32_t(index.x) - std::uint32_t(min_.x);
        const std::uint32_t y = std::uint32_t(index.y) - std::uint32_t(min_.y);
        const std::uint32_t z = std::uint32_t(index.z) - std::uint32_t(min_.z);
        if (x >= std::uint32_t(size_.x) || y >= std::uint32_t(size_.y) || z >= std::uint32_t(size_.z))
            return nullptr;
        return &dense_[(std::size_t(z) * std::size_t(size_.y) + y) * std::size_t(size_.x) + x];
    }

    Vec3i min_{0};
    Vec3i size_{0};
    std::vector<Value> dense_;
    std::unordered_map<Vec3i, Value, IndexHash> sparse_;
};

}  // namespace tessera
